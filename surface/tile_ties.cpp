#include "surface/tile_ties.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "core/morton.h"
#include "core/threshold.h"

namespace isobrick {
namespace {

constexpr int kLast = kTileSamples - 1;

/// Tiles around a tile: offset (x, y, z), each in −1 … 1, and back.
constexpr std::uint8_t neighbour(Int3 offset) {
  return static_cast<std::uint8_t>(offset.x + 1 + 3 * (offset.y + 1 + 3 * (offset.z + 1)));
}
constexpr Int3 offset_of(std::uint8_t neighbour) {
  return {neighbour % 3 - 1, neighbour / 3 % 3 - 1, neighbour / 9 - 1};
}

constexpr bool on_planes(std::uint32_t place) {
  const auto outer = [](std::uint32_t i) { return i == 0 || i == kLast; };
  return outer(place & 63) || outer(place >> 6 & 63) || outer(place >> 12);
}

/// Goes through the cells: marks the ties that kept triangles have corners on.
void mark_used(TileState& tile) {
  TileTies& ties = *tile.ties;
  std::memset(ties.used, 0, sizeof ties.used);
  ties.left_out = 0;
  for (const ActiveCell cell : tile.cells) {
    const int x = static_cast<int>(cell & 31), y = static_cast<int>(cell >> 5 & 31),
              z = static_cast<int>(cell >> 10 & 31);
    const std::uint32_t at = ties::corner_bits(ties.at, x, y, z);
    if (at == 0) continue;
    const auto use = [&](int vertex) {
      if (vertex >= 8) return;
      const int row = row_index(y + (vertex >> 1 & 1), z + (vertex >> 2));
      ties.used[row] |= std::uint64_t{1} << (x + (vertex & 1));
    };
    ties.left_out += ties::for_each_kept(kCaseTables, cell >> 16, at, [&](int a, int b, int c) {
      use(a);
      use(b);
      use(c);
    });
  }
}

/// Finds out which tile makes the vertex on a tie: the first in Morton order that
/// has a kept triangle there. That follows from the samples around it alone, so
/// all tiles find the same.
template <class T>
class TieOwner {
 public:
  TieOwner(const KernelContext& context, const TileState& tile)
      : context_(context),
        tile_(tile),
        samples_(reinterpret_cast<const T*>(tile.samples.data())),
        threshold_(Threshold<T>(context.isovalue).value),
        tie_(*tie_value<T>(context.isovalue)) {}

  /// The neighbour, for a tie that this tile has a kept triangle at.
  std::uint8_t find(Int3 p) const {
    std::uint8_t owner = TieVertex::kOwn;
    std::uint64_t first = morton_encode(tile_.work.tile);
    for (int corner = 0; corner < 8; ++corner) {
      const Int3 cell = p - Int3{corner & 1, corner >> 1 & 1, corner >> 2};
      const std::uint8_t of = neighbour({side(cell.x), side(cell.y), side(cell.z)});
      if (of == TieVertex::kOwn || of == owner || !exists(cell)) continue;
      const std::uint64_t code = morton_encode(tile_.work.tile + offset_of(of));
      if (code < first && has_triangle(cell, corner)) {
        first = code;
        owner = of;
      }
    }
    return owner;
  }

 private:
  static Index side(Index cell) { return cell < 0 ? -1 : cell < kTileEdge ? 0 : 1; }

  bool exists(Int3 cell) const {
    const Int3 lo = tile_.shape.origin + cell;
    return context_.roi.contains(lo) && context_.roi.contains(lo + Int3{1, 1, 1});
  }

  bool has_triangle(Int3 cell, int corner) const {
    std::uint32_t index = 0, at = 0;
    for (int c = 0; c < 8; ++c) {
      const T v = samples_[TileLayout::offset(static_cast<int>(cell.x) + (c & 1),
                                              static_cast<int>(cell.y) + (c >> 1 & 1),
                                              static_cast<int>(cell.z) + (c >> 2))];
      if (v != v) return false;
      index |= static_cast<std::uint32_t>(v >= threshold_) << c;
      at |= static_cast<std::uint32_t>(v == tie_) << c;
    }
    bool found = false;
    ties::for_each_kept(kCaseTables, index, at, [&](int a, int b, int c) {
      found = found || a == corner || b == corner || c == corner;
    });
    return found;
  }

  const KernelContext& context_;
  const TileState& tile_;
  const T* samples_;
  T threshold_, tie_;
};

/// Lists the used ties in the order of their places and numbers the tile's own.
template <class T>
void list_used(const KernelContext& context, bool alone, TileState& tile) {
  TileTies& ties = *tile.ties;
  const TieOwner<T> owner(context, tile);
  ties.vertices.clear();
  ties.own = 0;
  for (int row = 0; row < kTileRows; ++row) {
    ties.first[row] = static_cast<std::uint32_t>(ties.vertices.size());
    for (std::uint64_t word = ties.used[row]; word; word &= word - 1) {
      const int x = std::countr_zero(word), y = row % kTileSamples, z = row / kTileSamples;
      TieVertex vertex{static_cast<std::uint32_t>(x | y << 6 | z << 12), 0, TieVertex::kOwn};
      if (!alone && on_planes(vertex.place)) vertex.owner = owner.find({x, y, z});
      if (vertex.owner == TieVertex::kOwn) vertex.number = tile.edge_vertices + ties.own++;
      ties.vertices.resize(ties.vertices.size() + 1);
      ties.vertices[ties.vertices.size() - 1] = vertex;
    }
  }
}

}  // namespace

bool has_ties(ScalarType type, double isovalue) {
  return visit_scalar(type, [&](auto tag) {
    return tie_value<typename decltype(tag)::type>(isovalue).has_value();
  });
}

void count_ties(ScalarType type, const KernelContext& context, bool alone, TileState& tile) {
  mark_used(tile);
  visit_scalar(type,
               [&](auto tag) { list_used<typename decltype(tag)::type>(context, alone, tile); });
  tile.vertices = tile.edge_vertices + tile.ties->own;
  tile.triangles -= tile.ties->left_out;
}

void publish_ties(TileState& tile) {
  PodBuffer<FaceTie>& published = tile.boundary->ties;
  const auto for_each_shared = [&](auto&& f) {
    for (const TieVertex& vertex : tile.ties->vertices)
      if (vertex.owner == TieVertex::kOwn && on_planes(vertex.place)) f(vertex);
  };
  std::size_t count = 0;
  for_each_shared([&](const TieVertex&) { ++count; });
  published.clear();
  published.reserve(count);  // no more than that: boundaries are what a budget counts
  for_each_shared([&](const TieVertex& vertex) {
    published.resize(published.size() + 1);
    published[published.size() - 1] = {vertex.place, vertex.number};
  });
}

void adopt_ties(TileState& tile, const BoundaryMap& map) {
  for (TieVertex& vertex : tile.ties->vertices) {
    if (vertex.owner == TieVertex::kOwn) {
      vertex.number += tile.number_base;
      continue;
    }
    const Int3 offset = offset_of(vertex.owner);
    const TileBoundary& from = *map.find(tile.work.tile + offset);
    const auto along = [&](int axis) {
      return static_cast<std::uint32_t>((vertex.place >> 6 * axis & 63) - kTileEdge * offset[axis]);
    };
    const std::uint32_t place = along(0) | along(1) << 6 | along(2) << 12;
    const FaceTie* found =
        std::lower_bound(from.ties.begin(), from.ties.end(), place,
                         [](const FaceTie& tie, std::uint32_t p) { return tie.place < p; });
    vertex.number = from.base + found->number;
  }
}

}  // namespace isobrick
