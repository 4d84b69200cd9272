#include "python/src/array_source.h"

#include <algorithm>
#include <vector>

namespace isobrick::python {
namespace {

/// Bytes of samples that are read at a time before missing ones are replaced.
constexpr Index kPartBytes = Index{16} << 20;

}  // namespace

ArraySource::ArraySource(const Volume& volume, const std::string& name, std::size_t memory)
    : samples_(volume, SampleUse::labels), memory_(memory) {
  info_.extent = volume.extent;
  info_.type = samples_.lattice.type;
  info_.transform = volume.transform;
  info_.name = name;
}

std::size_t ArraySource::memory() const {
  return memory_ + (samples_.missing.any() && !samples_.array ? std::size_t{kPartBytes} : 0);
}

void ArraySource::read(Box3 box, std::byte* out) {
  if (samples_.array)
    samples_.array->copy(box, out);
  else if (samples_.missing.any())
    read_with_missing(box, out);
  else
    samples_.read(box, out);
}

/// Reads some planes at a time or, where one has too many samples, some rows.
void ArraySource::read_with_missing(Box3 box, std::byte* out) {
  const auto bytes = static_cast<Index>(size_of(samples_.read_type));
  const Int3 n = box.extent();
  const Index samples = kPartBytes / bytes;
  const Index planes = std::clamp(samples / (n.x * n.y), Index{1}, n.z);
  const Index rows = planes > 1 ? n.y : std::clamp(samples / n.x, Index{1}, n.y);
  std::vector<std::byte> raw;
  for (Index z = box.lo.z; z < box.hi.z; z += planes)
    for (Index y = box.lo.y; y < box.hi.y; y += rows) {
      const Box3 part = intersect(box, {{box.lo.x, y, z}, {box.hi.x, y + rows, z + planes}});
      const Int3 e = part.extent();
      raw.resize(static_cast<std::size_t>(volume(e) * bytes));
      samples_.read(part, raw.data());
      const SampleArray read{raw.data(), part, Int3{1, e.x, e.x * e.y} * bytes, samples_.read_type};
      ArraySamples(info_.extent, read, samples_.missing, samples_.use).copy(part, out);
      out += static_cast<std::size_t>(volume(e)) * size_of(info_.type);
    }
}

}  // namespace isobrick::python
