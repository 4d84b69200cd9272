#include "pipeline/pieces/neighbour_numbers.h"

#include <algorithm>

namespace isobrick::inline v0 {

void NeighbourNumbers::clear() {
  neighbours_.clear();
  vertices_ = 0;
}

void NeighbourNumbers::add(std::uint32_t vertices, std::uint32_t first) {
  neighbours_.push_back({vertices_, first});
  vertices_ += vertices;
}

std::uint32_t NeighbourNumbers::number_of(std::uint32_t vertex) const {
  const auto after = std::upper_bound(
      neighbours_.begin(), neighbours_.end(), vertex,
      [](std::uint32_t number, const Neighbour& tile) { return number < tile.begin; });
  const Neighbour& tile = *(after - 1);
  return tile.first + static_cast<std::uint32_t>(vertex - tile.begin);
}

bool NeighbourNumbers::renumber(std::span<Triangle> triangles, std::uint64_t first,
                                std::uint64_t own) const {
  const std::uint64_t end = vertices_ + own;
  const auto shift = static_cast<std::uint32_t>(first - vertices_);  // may wrap
  for (Triangle& triangle : triangles)
    for (std::uint32_t& vertex : triangle) {
      if (vertex >= end) return false;
      vertex = vertex >= vertices_ ? vertex + shift : number_of(vertex);
    }
  return true;
}

}  // namespace isobrick
