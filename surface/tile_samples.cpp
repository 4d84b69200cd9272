#include "surface/tile_samples.h"

#include <algorithm>

#include "core/copy_rows.h"

namespace isobrick::inline v0 {
namespace {

template <class T>
void gather_from_bricks(const Lattice& lattice, const BrickLookup& bricks, T fill, Index reach,
                        const TileWork& work, const TileBlock& block) {
  constexpr auto size = static_cast<Index>(sizeof(T));
  const RowStrides brick_strides{lattice.brick.x * size, lattice.brick.x * lattice.brick.y * size};
  const RowStrides block_strides{block.row * size, block.plane * size};
  const Int3 origin = work.tile * kTileEdge;
  for_each_needed_box(lattice, work, reach, [&](Box3 box) {
    for_each_point(lattice.bricks_of(box), [&](Int3 b) {
      const Int3 corner = b * lattice.brick;
      const Box3 part = intersect(box, {corner, corner + lattice.brick});
      const Int3 local = part.lo - origin, inner = part.lo - corner, n = part.extent();
      T* to = reinterpret_cast<T*>(block.samples) + block.origin + local.z * block.plane +
              local.y * block.row + local.x;
      if (const std::byte* from = bricks.find(b))
        copy_rows<sizeof(T)>(from + linear_index(inner, lattice.brick) * size, brick_strides,
                             reinterpret_cast<std::byte*>(to), block_strides, n);
      else
        for (Index z = 0; z < n.z; ++z)
          for (Index y = 0; y < n.y; ++y)
            std::fill_n(to + z * block.plane + y * block.row, n.x, fill);
    });
  });
}

}  // namespace

void BrickSamples::gather(const TileWork& work, Index reach, const TileBlock& block) const {
  visit_sample(lattice_.type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    gather_from_bricks<T>(lattice_, bricks_, fill_.as<T>(), reach, work, block);
  });
}

}  // namespace isobrick
