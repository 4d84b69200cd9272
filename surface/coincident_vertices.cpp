#include "surface/coincident_vertices.h"

#include "surface/patched_cells.h"

namespace isobrick::inline v0 {
namespace {

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
      tile.on_samples->used[row] |= std::uint64_t{1} << (x + (vertex & 1));
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

}  // namespace

bool has_coincident(ScalarType type, double isovalue) {
  return visit_scalar(type, [&](auto tag) {
    return coincident_value<typename decltype(tag)::type>(isovalue).has_value();
  });
}

void count_coincident(TileState& tile) {
  list_coincident_cells(tile);
  mark_used(tile);
  tile.triangles -= tile.coincident->left_out;
  tile.patched_triangles -= tile.coincident->patched_left_out;
}

}  // namespace isobrick
