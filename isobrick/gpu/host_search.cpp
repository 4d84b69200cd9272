#include "isobrick/gpu/host_search.h"

#include <algorithm>
#include <array>
#include <bit>
#include <span>

#include "isobrick/index/span_index.h"

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

HostSearch::HostSearch(const std::vector<Int3>& tiles, const std::vector<Range>& ranges,
                       IndexKind kind, Int3 grid)
    : HostSearch(tiles, ranges) {
  if (kind != IndexKind::octree) {
    index_ = build_index<double>(kind, ranges, {static_cast<Index>(ranges.size()), 1, 1});
    return;
  }
  std::vector<Range> placed(ranges.size());
  places_.resize(ranges.size());
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const auto place = static_cast<std::size_t>(linear_index(tiles[i], grid));
    placed[place] = ranges[i];
    places_[place] = static_cast<std::uint32_t>(i);
  }
  index_ = build_index<double>(kind, placed, grid);
}

void HostSearch::compare_ranges(double isovalue, FoundTiles& found) const {
  for (std::size_t first = 0; first < lo_.size(); first += 32) {
    const std::size_t count = std::min<std::size_t>(32, lo_.size() - first);
    std::uint32_t word = 0;
    // As ValueRange::stabbed_by, but without branches.
    for (std::size_t i = 0; i < count; ++i) {
      const unsigned above = lo_[first + i] < isovalue, reaches = isovalue <= hi_[first + i];
      word |= (above & reaches) << i;
    }
    found.words[first / 32] = word;
  }
}

void HostSearch::ask_index(double isovalue, FoundTiles& found) const {
  std::array<std::uint64_t, mask_words(kMostCandidates)> mask{};
  mark(view_index(index_), isovalue, std::span(mask).first(mask_words(tiles_.size())));
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (places_.empty()) {
      found.words[2 * i] = static_cast<std::uint32_t>(mask[i]);
      found.words[2 * i + 1] = static_cast<std::uint32_t>(mask[i] >> 32);
      continue;
    }
    for (std::uint64_t word = mask[i]; word != 0; word &= word - 1) {
      const std::uint32_t at = places_[64 * i + static_cast<std::size_t>(std::countr_zero(word))];
      found.words[at / 32] |= 1u << at % 32;
    }
  }
}

FoundTiles HostSearch::find(double isovalue) const {
  FoundTiles found;
  if (index_.empty())
    compare_ranges(isovalue, found);
  else
    ask_index(isovalue, found);
  for (std::size_t first = 0; first < tiles_.size(); first += 32) {
    std::uint32_t word = found.words[first / 32];
    for (; word != 0 && found.count < kMostActiveInSlabs; word &= word - 1)
      found.tiles[found.count++] = tiles_[first + static_cast<std::size_t>(std::countr_zero(word))];
    found.count += static_cast<std::uint32_t>(std::popcount(word));
  }
  return found;
}

}  // namespace isobrick::gpu
