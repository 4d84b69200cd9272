#include "io/volumes/synth/synth_cells.h"

#include <algorithm>
#include <cmath>

#include "io/volumes/synth/synth_math.h"

namespace isobrick::inline v0 {
namespace {

/// Beyond so many edges of a cube no seed is near.
constexpr float kReach = 0.7f;

double edge_of(const SynthOptions& options) {
  const Int3 e = options.extent;
  return static_cast<double>(std::max({e.x, e.y, e.z})) / *options.frequency;
}

Int3 grid_of(const SynthOptions& options) {
  Int3 grid;
  for (int axis = 0; axis < 3; ++axis)
    grid[axis] =
        std::max<Index>(1, static_cast<Index>(std::ceil(static_cast<double>(options.extent[axis]) /
                                                        edge_of(options))));
  return grid;
}

}  // namespace

double SynthCells::max_label(const SynthOptions& options) {
  const Int3 grid = grid_of(options);
  return static_cast<double>(grid.x) * static_cast<double>(grid.y) * static_cast<double>(grid.z);
}

SynthCells::SynthCells(const SynthOptions& options, Box3 box)
    : box_(box),
      seed_(options.seed),
      edge_(static_cast<float>(edge_of(options))),
      grid_(grid_of(options)) {}

/// The seeds in the 27 cubes around one that are near enough to a row.
void SynthCells::find_candidates(Int3 cube, float y, float z) {
  candidates_.clear();
  const Int3 lo = max(cube - Int3{1, 1, 1}, {0, 0, 0}), hi = min(cube + Int3{2, 2, 2}, grid_);
  for_each_point({lo, hi}, [&](Int3 p) {
    const std::uint32_t key = row_key(seed_, p.y, p.z) + static_cast<std::uint32_t>(p.x) * 3;
    const auto place = [&](Index corner, std::uint32_t i) {
      const float within = 0.5f + 0.4f * signed_unit<float>(scramble(key + i));
      return (static_cast<float>(corner) + within) * edge_;
    };
    const float dy = place(p.y, 1) - y, dz = place(p.z, 2) - z;
    const float off_row = dy * dy + dz * dz;
    if (off_row < kReach * kReach * edge_ * edge_)
      candidates_.push_back(
          {place(p.x, 0), off_row, static_cast<std::uint32_t>(linear_index(p, grid_)) + 1});
  });
}

void SynthCells::row(Index y, Index z, std::uint32_t* out) {
  const auto cube_of = [this](Index i, int axis) {
    return std::min(static_cast<Index>(static_cast<float>(i) / edge_), grid_[axis] - 1);
  };
  Index last_cube = -1;
  for (Index x = box_.lo.x; x < box_.hi.x; ++x) {
    const Index cube = cube_of(x, 0);
    if (cube != last_cube)
      find_candidates({cube, cube_of(y, 1), cube_of(z, 2)}, static_cast<float>(y),
                      static_cast<float>(z));
    last_cube = cube;
    float nearest = kReach * kReach * edge_ * edge_;
    std::uint32_t label = 0;
    for (const Candidate& c : candidates_) {
      const float dx = c.x - static_cast<float>(x);
      const float distance = dx * dx + c.off_row;
      label = distance < nearest ? c.label : label;
      nearest = std::min(nearest, distance);
    }
    *out++ = label;
  }
}

}  // namespace isobrick
