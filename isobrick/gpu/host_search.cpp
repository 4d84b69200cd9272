#include "isobrick/gpu/host_search.h"

#include <algorithm>
#include <bit>
#include <cstddef>

namespace isobrick::gpu {

HostSearch::HostSearch(const std::vector<Int3>& tiles, const std::vector<Range>& ranges) {
  for (const Range& range : ranges) {
    lo_.push_back(range.lo);
    hi_.push_back(range.hi);
  }
  for (const Int3 t : tiles)
    tiles_.push_back(FoundTiles::packed(static_cast<std::uint32_t>(t.x),
                                        static_cast<std::uint32_t>(t.y),
                                        static_cast<std::uint32_t>(t.z)));
}

FoundTiles HostSearch::find(double isovalue) const {
  FoundTiles found;
  found.count = 0;
  for (std::size_t first = 0; first < lo_.size(); first += 32) {
    const std::size_t count = std::min<std::size_t>(32, lo_.size() - first);
    std::uint32_t word = 0;
    // As ValueRange::stabbed_by, but without branches.
    for (std::size_t i = 0; i < count; ++i) {
      const unsigned above = lo_[first + i] < isovalue, reaches = isovalue <= hi_[first + i];
      word |= (above & reaches) << i;
    }
    found.words[first / 32] = word;
    for (; word != 0 && found.count < kMostActiveInSlabs; word &= word - 1)
      found.tiles[found.count++] = tiles_[first + static_cast<std::size_t>(std::countr_zero(word))];
    found.count += static_cast<std::uint32_t>(std::popcount(word));
  }
  return found;
}

}  // namespace isobrick::gpu
