#include "pipeline/pieces/neighbour_numbers.h"

#include <algorithm>
#include <cstddef>

namespace isobrick::inline v0 {

void NeighbourNumbers::clear() {
  neighbours_.clear();
  vertices_ = 0;
}

void NeighbourNumbers::add(std::uint32_t vertices, std::uint64_t first) {
  neighbours_.push_back({vertices_, first});
  vertices_ += vertices;
}

std::uint64_t NeighbourNumbers::number_of(std::uint32_t vertex) const {
  const auto after = std::upper_bound(
      neighbours_.begin(), neighbours_.end(), vertex,
      [](std::uint32_t number, const Neighbour& tile) { return number < tile.begin; });
  const Neighbour& tile = *(after - 1);
  return tile.first + (vertex - tile.begin);
}

template <class To>
bool NeighbourNumbers::renumber_to(std::span<const Triangle> triangles, std::uint64_t first,
                                   std::uint64_t own, To* to) const {
  using Number = typename To::value_type;
  const std::uint64_t end = vertices_ + own, shift = first - vertices_;  // may wrap
  for (const Triangle& triangle : triangles) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const std::uint32_t vertex = triangle[corner];
      if (vertex >= end) return false;
      (*to)[corner] = static_cast<Number>(vertex >= vertices_ ? vertex + shift : number_of(vertex));
    }
    ++to;
  }
  return true;
}

bool NeighbourNumbers::renumber(std::span<Triangle> triangles, std::uint64_t first,
                                std::uint64_t own) const {
  return renumber_to(std::span<const Triangle>(triangles), first, own, triangles.data());
}

bool NeighbourNumbers::renumber(std::span<const Triangle> triangles, std::uint64_t first,
                                std::uint64_t own, std::span<WideTriangle> wide) const {
  return renumber_to(triangles, first, own, wide.data());
}

}  // namespace isobrick
