#include "index/linear_scan.h"

#include "index/instantiate.h"
#include "index/span_items.h"

namespace isobrick::inline v0 {

using namespace index_detail;

template <class T>
std::vector<std::byte> LinearView<T>::build(IndexHeader header,
                                            std::span<const ValueRange<T>> ranges) {
  header.stored = count_active(ranges);
  auto block = make_block<LinearView>(header);
  const auto view = view_of<LinearView>(header, block.data());
  T* mins = writable(view.mins);
  T* maxs = writable(view.maxs);
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    const ValueRange<T> range = canonical(ranges[i]);
    mins[i] = range.lo;
    maxs[i] = range.hi;
  }
  return block;
}

template <class T>
void LinearView<T>::check(const IndexHeader& header) const {
  require(header.nodes == 0 && header.points == 0, "a linear scan has no nodes");
  std::uint32_t stored = 0;
  for (std::uint32_t i = 0; i < items; ++i) stored += mins[i] < maxs[i] ? 1 : 0;
  require(stored == header.stored, "number of ranges is not the header's");
}

#define ISOBRICK_INSTANTIATE(T) template struct LinearView<T>;
ISOBRICK_FOR_SAMPLE_TYPES(ISOBRICK_INSTANTIATE)
#undef ISOBRICK_INSTANTIATE

}  // namespace isobrick
