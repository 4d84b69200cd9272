#include "pipeline/extract/tile_sample.h"

#include <algorithm>

#include "core/morton.h"

namespace isobrick::inline v0 {
namespace {

/// The finalizer of SplitMix64, from its second number on.
std::uint64_t hash_of(const TileGroup& group) {
  std::uint64_t v = group.cube + 0x9e3779b97f4a7c15ULL;
  v = (v ^ v >> 30) * 0xbf58476d1ce4e5b9ULL;
  v = (v ^ v >> 27) * 0x94d049bb133111ebULL;
  return v ^ v >> 31;
}

bool before(const TileGroup& a, const TileGroup& b) { return hash_of(a) < hash_of(b); }

}  // namespace

void TileSample::add(const TileWork& work) {
  const std::uint64_t cube = morton_encode(work.tile) / 8;
  if (pending_.count > 0 && cube != pending_.cube) take_pending();
  pending_.cube = cube;
  pending_.tiles[pending_.count++] = work;
}

void TileSample::take_pending() {
  if (seen_++ % stratum_ != 0) {
    chosen_.back() = std::min(chosen_.back(), pending_, before);
  } else {
    if (chosen_.size() == most_) {
      for (std::size_t i = 0; i < most_ / 2; ++i)
        chosen_[i] = std::min(chosen_[2 * i], chosen_[2 * i + 1], before);
      chosen_.resize(most_ / 2);
      stratum_ *= 2;
    }
    chosen_.push_back(pending_);
  }
  pending_.count = 0;
}

std::vector<TileGroup> TileSample::chosen() const {
  TileSample whole = *this;
  if (pending_.count > 0) whole.take_pending();
  return whole.chosen_;
}

}  // namespace isobrick
