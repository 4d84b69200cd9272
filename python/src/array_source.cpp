#include "python/src/array_source.h"

namespace isobrick::python {

ArraySource::ArraySource(const Volume& volume, const std::string& name, std::size_t memory)
    : samples_(volume), memory_(memory) {
  info_.extent = volume.extent;
  info_.type = samples_.lattice.type;
  info_.transform = volume.transform;
  info_.name = name;
}

void ArraySource::read(Box3 box, std::byte* out) {
  if (samples_.array)
    samples_.array->copy(box, out);
  else
    samples_.read(box, out);
}

}  // namespace isobrick::python
