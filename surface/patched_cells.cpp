#include "surface/patched_cells.h"

#include "surface/case_tables.h"

namespace isobrick::inline v0 {
namespace {

template <class T>
void count(const KernelContext& context, TileState& tile) {
  const TopologyTables& tables = topology_tables();
  const T* samples = reinterpret_cast<const T*>(tile.samples.data());
  tile.clear_patched();
  std::uint32_t left_to_tables = tile.triangles;
  tile.patched.resize(tile.cells.size());
  PatchedCell* out = tile.patched.begin();
  ActiveCell* kept = tile.cells.begin();
  for (const ActiveCell cell : tile.cells) {
    const std::uint32_t index = cell >> 16;
    const CaseConfigurations& of_case = tables.cases[index];
    if (of_case.needs_values) {
      const CellValues<T> values(samples, context.isovalue, static_cast<int>(cell & 31),
                                 static_cast<int>(cell >> 5 & 31),
                                 static_cast<int>(cell >> 10 & 31));
      const int patch = cell_topology::patch_of(tables, static_cast<int>(index), values.d);
      if (patch != of_case.consistent_patch) {
        *out++ = {cell, static_cast<std::uint32_t>(patch)};
        left_to_tables -= kCaseTables.triangles[index];
        tile.patched_triangles += tables.patches[patch].triangles;
        tile.inner_vertices += tables.patches[patch].inner;
        continue;
      }
    }
    *kept++ = cell;
  }
  tile.patched.resize(static_cast<std::size_t>(out - tile.patched.begin()));
  tile.cells.resize(static_cast<std::size_t>(kept - tile.cells.begin()));
  tile.triangles = left_to_tables + tile.patched_triangles;
  tile.vertices = tile.edge_vertices + tile.inner_vertices;
}

}  // namespace

void count_patched_cells(ScalarType type, const KernelContext& context, TileState& tile) {
  visit_scalar(type, [&](auto tag) { count<typename decltype(tag)::type>(context, tile); });
}

}  // namespace isobrick
