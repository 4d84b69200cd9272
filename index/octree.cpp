#include "index/octree.h"

#include <algorithm>

#include "index/instantiate.h"
#include "index/span_items.h"

namespace isobrick::inline v0 {

using namespace index_detail;

namespace {

/// The ranges of one row of a level from the rows below it.
template <class T>
void reduce_row(const ValueRange<T>* const* rows, int count, std::uint32_t width,
                ValueRange<T>* out) {
  const std::uint32_t pairs = width / 2;
  for (std::uint32_t x = 0; x < (width + 1) / 2; ++x) {
    ValueRange<T> range;
    for (int r = 0; r < count; ++r) {
      range.include(rows[r][2 * x]);
      if (x < pairs) range.include(rows[r][2 * x + 1]);
    }
    out[x] = range;
  }
}

/// Calls f(offset, width, row) for each row of `level`, made from the level
/// below; `row` is valid during the call.
template <class T, class F>
void for_each_reduced_row(const OctreeView<T>& view, int level, F&& f) {
  const std::uint32_t* below = view.pyramid[level - 1].extent;
  const std::uint32_t width = view.pyramid[level].extent[0];
  std::vector<ValueRange<T>> row(width);
  std::uint64_t offset = view.pyramid[level].first;
  for (std::uint64_t z = 0; z < below[2]; z += 2)
    for (std::uint64_t y = 0; y < below[1]; y += 2, offset += width) {
      const ValueRange<T>* rows[4];
      int count = 0;
      for (std::uint64_t v = z; v < std::min<std::uint64_t>(z + 2, below[2]); ++v)
        for (std::uint64_t u = y; u < std::min<std::uint64_t>(y + 2, below[1]); ++u)
          rows[count++] =
              view.ranges + view.pyramid[level - 1].first + (v * below[1] + u) * below[0];
      reduce_row(rows, count, below[0], row.data());
      f(offset, width, row.data());
    }
}

}  // namespace

template <class T>
std::vector<std::byte> OctreeView<T>::build(IndexHeader header,
                                            std::span<const ValueRange<T>> ranges) {
  header.stored = count_active(ranges);
  auto block = make_block<OctreeView>(header);
  const auto view = view_of<OctreeView>(header, block.data());
  ValueRange<T>* out = writable(view.ranges);
  for (std::size_t i = 0; i < ranges.size(); ++i) out[i] = canonical(ranges[i]);
  for (int level = 1; level < view.levels; ++level)
    for_each_reduced_row(view, level,
                         [&](std::uint64_t offset, std::uint32_t width, const ValueRange<T>* row) {
                           std::copy_n(row, width, out + offset);
                         });
  return block;
}

template <class T>
void OctreeView<T>::check(const IndexHeader& header) const {
  require(header.nodes == 0 && header.points == 0, "an octree's nodes are those of its grid");
  std::uint32_t stored = 0;
  for (std::uint32_t i = 0; i < header.items; ++i) {
    require(ranges[i] == canonical(ranges[i]), "a range that is never active is not written so");
    stored += can_be_active(ranges[i]) ? 1 : 0;
  }
  require(stored == header.stored, "number of ranges is not the header's");
  for (int level = 1; level < levels; ++level)
    for_each_reduced_row(*this, level,
                         [&](std::uint64_t offset, std::uint32_t width, const ValueRange<T>* row) {
                           require(std::equal(row, row + width, ranges + offset),
                                   "a node's range is not that of its items");
                         });
}

#define ISOBRICK_INSTANTIATE(T) template struct OctreeView<T>;
ISOBRICK_FOR_SAMPLE_TYPES(ISOBRICK_INSTANTIATE)
#undef ISOBRICK_INSTANTIATE

}  // namespace isobrick
