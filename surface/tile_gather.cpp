#include "surface/tile_gather.h"

#include <algorithm>
#include <cstring>

namespace isobrick {
namespace {

/// Copies rows of N samples, or of n.x when N is 0: of known length, a row is a
/// move or two.
template <int N, class T>
void copy_rows(const T* from, Int3 from_extent, T* to, Int3 n, Index to_row, Index to_plane) {
  const std::size_t bytes = static_cast<std::size_t>(N ? N : n.x) * sizeof(T);
  for (Index z = 0; z < n.z; ++z) {
    const T* row = from + z * from_extent.x * from_extent.y;
    T* out = to + z * to_plane;
    for (Index y = 0; y < n.y; ++y, row += from_extent.x, out += to_row)
      std::memcpy(out, row, bytes);
  }
}

/// Rows are mostly one of a few lengths: half a tile or a whole one, with or
/// without what it shares with its neighbours, or only that.
template <class T>
void copy_part(const T* from, Int3 from_extent, T* to, Int3 n, Index row, Index plane) {
  switch (n.x) {
    case 1: return copy_rows<1>(from, from_extent, to, n, row, plane);
    case 16: return copy_rows<16>(from, from_extent, to, n, row, plane);
    case 17: return copy_rows<17>(from, from_extent, to, n, row, plane);
    case 32: return copy_rows<32>(from, from_extent, to, n, row, plane);
    case 33: return copy_rows<33>(from, from_extent, to, n, row, plane);
    case 34: return copy_rows<34>(from, from_extent, to, n, row, plane);
    case 35: return copy_rows<35>(from, from_extent, to, n, row, plane);
    default: return copy_rows<0>(from, from_extent, to, n, row, plane);
  }
}

template <class T>
void gather(const Lattice& lattice, const BrickLookup& bricks, double fill, Index reach,
            const TileWork& work, const TileBlock& block) {
  const Int3 origin = work.tile * kTileEdge;
  for_each_needed_box(lattice, work, reach, [&](Box3 box) {
    for_each_point(lattice.bricks_of(box), [&](Int3 b) {
      const Int3 corner = b * lattice.brick;
      const Box3 part = intersect(box, {corner, corner + lattice.brick});
      const Int3 local = part.lo - origin, inner = part.lo - corner, n = part.extent();
      T* to = reinterpret_cast<T*>(block.samples) + block.origin + local.z * block.plane +
              local.y * block.row + local.x;
      if (const auto* from = reinterpret_cast<const T*>(bricks.find(b)))
        copy_part(from + linear_index(inner, lattice.brick), lattice.brick, to, n, block.row,
                  block.plane);
      else
        for (Index z = 0; z < n.z; ++z)
          for (Index y = 0; y < n.y; ++y)
            std::fill_n(to + z * block.plane + y * block.row, n.x, static_cast<T>(fill));
    });
  });
}

}  // namespace

void gather_samples(const Lattice& lattice, const BrickLookup& bricks, double fill, Index reach,
                    const TileWork& work, const TileBlock& block) {
  visit_scalar(lattice.type, [&](auto tag) {
    gather<typename decltype(tag)::type>(lattice, bricks, fill, reach, work, block);
  });
}

void gather_samples(const Lattice& lattice, const BrickLookup& bricks, double fill, Index reach,
                    TileState& tile) {
  tile.samples.resize(TileLayout::kSize * lattice.sample_bytes());
  gather_samples(lattice, bricks, fill, reach, tile.work,
                 {tile.samples.data(), TileLayout::kOrigin, TileLayout::kRow, TileLayout::kPlane});
}

}  // namespace isobrick
