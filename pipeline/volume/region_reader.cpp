#include "pipeline/volume/region_reader.h"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace isobrick::inline v0 {

RegionReader::~RegionReader() {
  if (reading_.valid()) reading_.wait();
}

void RegionReader::begin(Box3 box) {
  PodBuffer<std::byte>& buffer = buffers_[next_];
  buffer.clear();
  buffer.resize(static_cast<std::size_t>(volume(box.extent())) * size_of(type_));
  box_ = box;
  reading_ = std::async(std::launch::async, [this, box, out = buffer.data()] { read(box, out); });
}

SampleArray RegionReader::take() {
  reading_.get();
  const auto size = static_cast<Index>(size_of(type_));
  const Int3 n = box_.extent();
  const SampleArray array{
      buffers_[next_].data(), box_, {size, size * n.x, size * n.x * n.y}, type_};
  next_ = 1 - next_;
  return array;
}

void RegionReader::read(Box3 box, std::byte* out) const {
  const Index planes = box.hi.z - box.lo.z;
  const Index parts = concurrent_ ? std::min<Index>(planes, workers_.threads()) : 1;
  if (parts == 1) return read_(box, out);
  const Index plane_bytes =
      (box.hi.x - box.lo.x) * (box.hi.y - box.lo.y) * static_cast<Index>(size_of(type_));
  workers_.execute([&] {
    tbb::parallel_for(Index{0}, parts, [&](Index i) {
      Box3 part = box;
      part.lo.z = box.lo.z + planes * i / parts;
      part.hi.z = box.lo.z + planes * (i + 1) / parts;
      read_(part, out + (part.lo.z - box.lo.z) * plane_bytes);
    });
  });
}

}  // namespace isobrick
