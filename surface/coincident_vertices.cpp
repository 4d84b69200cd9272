#include "surface/coincident_vertices.h"

#include <bit>
#include <cstring>

#include "core/threshold.h"
#include "surface/patched_cells.h"
#include "surface/sample_vertices.h"

namespace isobrick::inline v0 {
namespace {

constexpr bool on_planes(std::uint32_t place) {
  const auto outer = [](std::uint32_t i) { return i == 0 || i == kTileSamples - 1; };
  return outer(place & 63) || outer(place >> 6 & 63) || outer(place >> 12);
}

/// The coincident vertices among a cell's corners.
std::uint32_t coincident_corners(const CoincidentVertices& coincident, ActiveCell cell) {
  return coincident::corner_bits(coincident.at, static_cast<int>(cell & 31),
                                 static_cast<int>(cell >> 5 & 31),
                                 static_cast<int>(cell >> 10 & 31));
}

/// Moves the cells with a coincident vertex to a list of their own: their triangles come behind
/// those of all others.
void list_coincident_cells(TileState& tile) {
  CoincidentVertices& coincident = *tile.coincident;
  coincident.cells.clear();
  coincident.cells.reserve(tile.cells.size());
  std::size_t others = 0;
  for (const ActiveCell cell : tile.cells) {
    if (coincident_corners(coincident, cell) == 0) {
      tile.cells[others++] = cell;
      continue;
    }
    coincident.cells.resize(coincident.cells.size() + 1);
    coincident.cells[coincident.cells.size() - 1] = cell;
  }
  tile.cells.resize(others);
}

/// Goes through the cells: marks the coincident vertices that kept triangles have corners on.
void mark_used(TileState& tile) {
  CoincidentVertices& coincident = *tile.coincident;
  std::memset(coincident.used, 0, sizeof coincident.used);
  coincident.triangles = coincident.left_out = coincident.patched_left_out = 0;
  // Returns how many of a cell's triangles are left out.
  const auto mark = [&](ActiveCell cell, const std::uint8_t* edges, int triangles) {
    const int x = static_cast<int>(cell & 31), y = static_cast<int>(cell >> 5 & 31),
              z = static_cast<int>(cell >> 10 & 31);
    const std::uint32_t at = coincident_corners(coincident, cell);
    if (at == 0) return std::uint32_t{0};
    const auto use = [&](int vertex) {
      if (vertex >= 8) return;
      const int row = row_index(y + (vertex >> 1 & 1), z + (vertex >> 2));
      coincident.used[row] |= std::uint64_t{1} << (x + (vertex & 1));
    };
    return coincident::for_each_kept(edges, triangles, at, [&](int a, int b, int c) {
      use(a);
      use(b);
      use(c);
    });
  };
  for (const ActiveCell cell : coincident.cells) {
    const std::uint32_t triangles = kCaseTables.triangles[cell >> 16];
    const std::uint32_t left_out =
        mark(cell, kCaseTables.edges[cell >> 16].data(), static_cast<int>(triangles));
    coincident.left_out += left_out;
    coincident.triangles += triangles - left_out;
  }
  if (tile.patched.size() == 0) return;
  const TopologyTables& tables = topology_tables();
  for (const PatchedCell& cell : tile.patched) {
    const CellPatch& patch = tables.patches[cell.patch];
    coincident.patched_left_out += mark(cell.cell, tables.corners + patch.first, patch.triangles);
  }
  coincident.left_out += coincident.patched_left_out;
}

/// Finds out which tile makes the vertex on a coincident vertex: the first in Morton order that
/// has a kept triangle there. That follows from the samples around it alone, so
/// all tiles find the same.
template <class T>
class CoincidentOwner {
 public:
  CoincidentOwner(const KernelContext& context, const TileState& tile)
      : context_(context),
        tile_(tile),
        samples_(reinterpret_cast<const T*>(tile.samples.data())),
        threshold_(Threshold<T>(context.isovalue).value),
        coincident_(*coincident_value<T>(context.isovalue)) {}

  /// The neighbour, for a coincident vertex that this tile has a kept triangle at.
  std::uint8_t find(Int3 p) const {
    return first_tile_at(tile_.work.tile, p, [&](Int3 cell, int corner) {
      return exists(cell) && has_triangle(cell, corner);
    });
  }

 private:
  bool exists(Int3 cell) const {
    const Int3 lo = tile_.shape.origin + cell;
    return context_.roi.contains(lo) && context_.roi.contains(lo + Int3{1, 1, 1});
  }

  bool has_triangle(Int3 cell, int corner) const {
    const int x = static_cast<int>(cell.x), y = static_cast<int>(cell.y),
              z = static_cast<int>(cell.z);
    std::uint32_t index = 0, at = 0;
    for (int c = 0; c < 8; ++c) {
      const T v = samples_[TileLayout::offset(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2))];
      if (v != v) return false;
      index |= static_cast<std::uint32_t>(v >= threshold_) << c;
      at |= static_cast<std::uint32_t>(v == coincident_) << c;
    }
    bool found = false;
    const auto look_at = [&](int a, int b, int c) {
      found = found || a == corner || b == corner || c == corner;
    };
    if (!context_.trilinear) {
      coincident::for_each_kept(kCaseTables, index, at, look_at);
      return found;
    }
    const TopologyTables& tables = topology_tables();
    const CellValues<T> values(samples_, context_.isovalue, x, y, z);
    const CellPatch& patch =
        tables.patches[cell_topology::patch_of(tables, static_cast<int>(index), values.d)];
    coincident::for_each_kept(tables.corners + patch.first, patch.triangles, at, look_at);
    return found;
  }

  const KernelContext& context_;
  const TileState& tile_;
  const T* samples_;
  T threshold_, coincident_;
};

/// Lists the used coincident vertices in the order of their places and numbers the tile's own.
template <class T>
void list_used(const KernelContext& context, bool unwelded, TileState& tile) {
  CoincidentVertices& coincident = *tile.coincident;
  const CoincidentOwner<T> owner(context, tile);
  coincident.vertices.clear();
  coincident.own = 0;
  for (int row = 0; row < kTileRows; ++row) {
    coincident.first[row] = static_cast<std::uint32_t>(coincident.vertices.size());
    for (std::uint64_t word = coincident.used[row]; word; word &= word - 1) {
      const int x = std::countr_zero(word), y = row % kTileSamples, z = row / kTileSamples;
      SampleVertex vertex{static_cast<std::uint32_t>(x | y << 6 | z << 12), 0, SampleVertex::kOwn};
      if (!unwelded && on_planes(vertex.place)) vertex.owner = owner.find({x, y, z});
      if (vertex.owner == SampleVertex::kOwn)
        vertex.number = tile.edge_vertices + tile.inner_vertices + coincident.own++;
      coincident.vertices.resize(coincident.vertices.size() + 1);
      coincident.vertices[coincident.vertices.size() - 1] = vertex;
    }
  }
}

}  // namespace

bool has_coincident(ScalarType type, double isovalue) {
  return visit_scalar(type, [&](auto tag) {
    return coincident_value<typename decltype(tag)::type>(isovalue).has_value();
  });
}

void count_coincident(ScalarType type, const KernelContext& context, bool unwelded,
                      TileState& tile) {
  list_coincident_cells(tile);
  mark_used(tile);
  visit_scalar(type,
               [&](auto tag) { list_used<typename decltype(tag)::type>(context, unwelded, tile); });
  tile.vertices = tile.edge_vertices + tile.inner_vertices + tile.coincident->own;
  tile.triangles -= tile.coincident->left_out;
  tile.patched_triangles -= tile.coincident->patched_left_out;
}

void publish_coincident(TileState& tile) {
  publish_samples(tile.coincident->vertices.span(), on_planes, tile.boundary->coincident);
}

void adopt_coincident(TileState& tile, const BoundaryMap& map) {
  adopt_samples(tile, &TileBoundary::coincident, map, tile.coincident->vertices);
}

}  // namespace isobrick
