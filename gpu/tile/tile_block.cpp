#include "gpu/tile/tile_block.h"

#include <algorithm>
#include <cstring>

namespace isobrick::inline v0::gpu {
namespace {

constexpr Int3 kPage{kTileEdge, kTileEdge, kTileEdge};

template <class T>
bool gather(const Lattice& lattice, const BrickLookup& bricks, double fill, Int3 tile, T* block) {
  const Int3 origin = tile * kTileEdge;
  const Box3 box = intersect({origin, origin + kPage}, lattice.box());
  bool any = false;
  for_each_point(lattice.bricks_of(box), [&](Int3 b) {
    const Int3 corner = b * lattice.brick;
    const Box3 part = intersect(box, {corner, corner + lattice.brick});
    const T* from = reinterpret_cast<const T*>(bricks.find(b));
    any = any || from;
    for (Index z = part.lo.z; z < part.hi.z; ++z)
      for (Index y = part.lo.y; y < part.hi.y; ++y) {
        T* to = block + linear_index(Int3{part.lo.x, y, z} - origin, kPage);
        const auto n = static_cast<std::size_t>(part.extent().x);
        if (from)
          std::memcpy(to, from + linear_index(Int3{part.lo.x, y, z} - corner, lattice.brick),
                      n * sizeof(T));
        else
          std::fill_n(to, n, static_cast<T>(fill));
      }
  });
  return any;
}

}  // namespace

bool gather_tile_block(const Lattice& lattice, const BrickLookup& bricks, double fill_value,
                       Int3 tile, std::byte* block) {
  return visit_scalar(lattice.type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    return gather<T>(lattice, bricks, fill_value, tile, reinterpret_cast<T*>(block));
  });
}

void fill_tile_block(ScalarType type, double value, std::byte* block) {
  visit_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    std::fill_n(reinterpret_cast<T*>(block), kTileEdge * kTileEdge * kTileEdge,
                static_cast<T>(value));
  });
}

}  // namespace isobrick::gpu
