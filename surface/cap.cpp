#include "surface/cap.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace isobrick::inline v0 {
namespace {

/// Bits lo … hi − 1.
constexpr std::uint64_t bits_between(Index lo, Index hi) {
  return hi <= lo ? 0 : (std::uint64_t{1} << hi) - (std::uint64_t{1} << lo);
}

/// Cells of the region, whatever their samples.
void find_cells(const KernelContext& context, TileState& tile) {
  const Int3 lo = context.border.lo - tile.shape.origin,
             hi = context.border.hi - Int3{1, 1, 1} - tile.shape.origin;
  const auto within = [](Index i) { return std::min<Index>(std::max<Index>(i, -1), kTileSamples); };
  const std::uint64_t row = bits_between(within(lo.x) + 1, within(hi.x) + 1);
  constexpr int edge = ExistingCells::kEdge;
  for (int z = -1; z < kTileSamples; ++z)
    for (int y = -1; y < kTileSamples; ++y)
      tile.cap->cells.rows[(z + 1) * edge + y + 1] =
          y >= lo.y && y < hi.y && z >= lo.z && z < hi.z ? row : 0;
}

/// Takes the cells with a NaN corner out.
template <class T>
void leave_out_nan(const KernelContext& context, TileState& tile) {
  constexpr int edge = kTileSamples + 2;  // samples −1 … 33
  const T* samples = reinterpret_cast<const T*>(tile.samples.data());
  std::uint64_t nan[edge * edge];
  // What lies outside of the region was not gathered, and no cell there exists.
  const auto exists = [&](int axis, int i) {
    const Index p = tile.shape.origin[axis] + i;
    return p >= context.border.lo[axis] && p < context.border.hi[axis];
  };
  std::uint64_t columns = 0;
  for (int x = -1; x <= kTileSamples; ++x)
    columns |= static_cast<std::uint64_t>(exists(0, x)) << (x + 1);
  for (int z = -1; z <= kTileSamples; ++z)
    for (int y = -1; y <= kTileSamples; ++y) {
      std::uint64_t& word = nan[(z + 1) * edge + y + 1];
      word = 0;
      if (!exists(1, y) || !exists(2, z)) continue;
      const T* row = samples + TileLayout::offset(0, y, z);
      for (int x = -1; x <= kTileSamples; ++x)
        word |= static_cast<std::uint64_t>(row[x] != row[x]) << (x + 1);
      word &= columns;
    }
  for (int z = 0; z < ExistingCells::kEdge; ++z)
    for (int y = 0; y < ExistingCells::kEdge; ++y) {
      const std::uint64_t any = nan[z * edge + y] | nan[z * edge + y + 1] |
                                nan[(z + 1) * edge + y] | nan[(z + 1) * edge + y + 1];
      tile.cap->cells.rows[z * ExistingCells::kEdge + y] &= ~(any | any >> 1);
    }
}

/// The faces of the cells in a row that lie at the border, as bits x + 1.
struct BorderRow {
  std::uint64_t faces[6];

  BorderRow(const TileState& tile, int y, int z) {
    const ExistingCells& cells = tile.cap->cells;
    const std::uint64_t all = cells.at(y, z);
    const std::uint64_t own = all & bits_between(tile.shape.lo[0] + 1, tile.shape.hi[0] + 1);
    faces[0] = own & ~(all << 1);
    faces[1] = own & ~(all >> 1);
    faces[2] = own & ~cells.at(y - 1, z);
    faces[3] = own & ~cells.at(y + 1, z);
    faces[4] = own & ~cells.at(y, z - 1);
    faces[5] = own & ~cells.at(y, z + 1);
  }
  std::uint64_t any() const {
    return faces[0] | faces[1] | faces[2] | faces[3] | faces[4] | faces[5];
  }
};

/// Lists the faces of a row of cells that have triangles, and marks the samples at their corners.
template <class T>
void list_faces(const KernelContext& context, TileState& tile, int y, int z) {
  const BorderRow border(tile, y, z);
  const std::uint64_t* inside = tile.inside + row_index(y, z);
  const std::uint64_t flip = context.inside == Inside::below ? ~std::uint64_t{0} : 0;
  const std::uint64_t rows[4] = {inside[0] ^ flip, inside[1] ^ flip, inside[kTileSamples] ^ flip,
                                 inside[kTileSamples + 1] ^ flip};
  TileCap& cap = *tile.cap;
  for (std::uint64_t word = border.any(); word; word &= word - 1) {
    const int bit = std::countr_zero(word), x = bit - 1;
    std::uint32_t corners = 0;
    for (int i = 0; i < 4; ++i) corners |= static_cast<std::uint32_t>(rows[i] >> x & 3) << 2 * i;
    if (corners == 0) continue;
    const std::uint32_t at =
        tile.coincident ? coincident::corner_bits(tile.coincident->at, x, y, z) : 0;
    const auto use = [&](int vertex) {
      if (vertex >= 8) return;
      const int row = row_index(y + (vertex >> 1 & 1), z + (vertex >> 2));
      tile.on_samples->used[row] |= std::uint64_t{1} << (x + (vertex & 1));
    };
    for (int f = 0; f < 6; ++f) {
      if (!(border.faces[f] >> bit & 1)) continue;
      const std::uint32_t polygon = polygon_of<T>(context, tile, x, y, z, f, corners);
      std::uint32_t kept = 0;
      const std::uint32_t left_out = for_each_cap_triangle(static_cast<std::uint32_t>(f), polygon,
                                                           at, [&](int a, int b, int c) {
                                                             use(a);
                                                             use(b);
                                                             use(c);
                                                             ++kept;
                                                           });
      if (tile.coincident) tile.coincident->left_out += left_out;
      if (kept == 0) continue;
      cap.triangles += kept;
      cap.faces.resize(cap.faces.size() + 1);
      cap.faces[cap.faces.size() - 1] =
          static_cast<CapFace>(x | y << 5 | z << 10 | f << 15) | polygon << 18;
    }
  }
}

}  // namespace

AxisNormals axis_normals(const WorldMap& world, Inside inside) {
  const double sign = inside == Inside::below ? -1 : 1;  // the map's normals are reversed
  AxisNormals normals{};
  for (int a = 0; a < 3; ++a) {
    double n[3], length = 0;
    for (int row = 0; row < 3; ++row) {
      n[row] = sign * static_cast<double>(world.normal[3 * row + a]);
      length += n[row] * n[row];
    }
    for (int row = 0; row < 3; ++row) normals.axis[a][row] = n[row] / std::sqrt(length);
  }
  return normals;
}

CapBounds cap_bounds(const SurfaceOptions& options) {
  if (!options.cap) return {};
  constexpr std::uint64_t edge = kTileEdge, samples = kTileSamples, inner = kTileSamples - 2;
  if (options.may_have_nan)
    return {3 * samples * edge * edge, samples * samples * samples,
            samples * samples * samples - inner * inner * inner};
  std::uint64_t planes = 0;  // of the region's border in one tile
  for (int axis = 0; axis < 3; ++axis) {
    const Index first = options.roi.lo[axis] / kTileEdge;
    planes += options.roi.hi[axis] - 1 > (first + 1) * kTileEdge ? 1 : 2;
  }
  return {planes * edge * edge, planes * samples * samples, planes * 4 * edge};
}

void count_cap(ScalarType type, const KernelContext& context, TileState& tile) {
  TileCap& cap = *tile.cap;
  cap.clear();
  const Box3 around{tile.shape.origin - Int3{1, 1, 1},
                    tile.shape.origin + Int3{kTileSamples + 1, kTileSamples + 1, kTileSamples + 1}};
  cap.near = context.may_have_nan || intersect(around, context.border) != around;
  if (!cap.near) return;
  find_cells(context, tile);
  visit_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    if (std::is_floating_point_v<T> && context.may_have_nan) leave_out_nan<T>(context, tile);
    for (int z = tile.shape.lo[2]; z < tile.shape.hi[2]; ++z)
      for (int y = tile.shape.lo[1]; y < tile.shape.hi[1]; ++y) list_faces<T>(context, tile, y, z);
  });
  tile.triangles += cap.triangles;
}

}  // namespace isobrick
