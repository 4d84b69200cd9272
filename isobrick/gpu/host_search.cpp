#include "isobrick/gpu/host_search.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <span>

#include "isobrick/core/threshold.h"
#include "isobrick/index/span_index.h"

namespace isobrick::gpu {

HostSearch::HostSearch(const std::vector<Int3>& tiles, const std::vector<Range>& ranges)
    : count_(tiles.size()) {
  for (const Range& range : ranges) {
    lo_.push_back(static_cast<float>(range.lo));
    hi_.push_back(static_cast<float>(range.hi));
  }
  if (tiles.size() > kMostInSlabs) return;
  for (const Int3 t : tiles)
    packed_.push_back(FoundTiles::packed(static_cast<std::uint32_t>(t.x),
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
  // No float lies between the isovalue and the threshold, so it stabs the same.
  const Threshold<float> threshold(isovalue);
  if (threshold.none) return;
  const float t = threshold.value;
  for (std::size_t first = 0; first < count_; first += 32) {
    const std::size_t count = std::min<std::size_t>(32, count_ - first);
    std::array<std::uint8_t, 32> is_stabbed{};
    // As ValueRange::stabbed_by, but without branches, so that several are compared at once.
    for (std::size_t i = 0; i < count; ++i)
      is_stabbed[i] = static_cast<std::uint8_t>((lo_[first + i] < t) & (t <= hi_[first + i]));
    std::uint32_t word = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      std::uint64_t eight = 0;
      std::memcpy(&eight, &is_stabbed[8 * i], 8);
      // Byte b times 2^(56 - 7b) has its bit at 56 + b.
      word |= static_cast<std::uint32_t>(eight * 0x0102040810204080u >> 56) << 8 * i;
    }
    found.words[first / 32] = word;
  }
}

void HostSearch::ask_index(double isovalue, FoundTiles& found) const {
  std::array<std::uint64_t, mask_words(kMostThroughIndex)> mask{};
  mark(view_index(index_), isovalue, std::span(mask).first(mask_words(count_)));
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
  for (std::size_t first = 0; first < count_; first += 32) {
    std::uint32_t word = found.words[first / 32];
    if (!packed_.empty())
      for (; word != 0 && found.count < kMostActiveInSlabs; word &= word - 1)
        found.tiles[found.count++] =
            packed_[first + static_cast<std::size_t>(std::countr_zero(word))];
    found.count += static_cast<std::uint32_t>(std::popcount(word));
  }
  return found;
}

}  // namespace isobrick::gpu
