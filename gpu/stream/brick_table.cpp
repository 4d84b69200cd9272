#include "gpu/stream/brick_table.h"

#include <algorithm>

#include "core/flat_map.h"

namespace isobrick::inline v0::gpu {
namespace {

/// What of a brick the tiles of a launch need.
struct Need {
  const std::byte* brick = nullptr;
  std::uint64_t samples = 0;  ///< what several tiles need counts for each
  std::uint64_t address = 0;
};

/// The bricks that the tile's samples, `reach` layers around included, lie in.
Box3 bricks_around(const Lattice& lattice, Index reach, Int3 tile) {
  const Index before = std::max<Index>(reach, 0), edge = kTileEdge + 1 + reach;
  const Int3 lo = tile * kTileEdge;
  return lattice.bricks_of(
      intersect({lo - Int3{before, before, before}, lo + Int3{edge, edge, edge}}, lattice.box()));
}

/// Collects the bricks of a launch, each looked up once.
class Needs {
 public:
  Needs(const BrickLookup& bricks, Int3 grid, std::size_t tiles)
      : bricks_(bricks), grid_(grid), numbers_(tiles) {}

  /// The number of a brick, counted from 1; 0 when it is absent.
  std::size_t number_of(Int3 b) {
    const auto [number, added] =
        numbers_.insert(static_cast<std::uint64_t>(linear_index(b, grid_)));
    if (!added) return number;
    if (const std::byte* brick = bricks_.find(b)) {
      all_.push_back({brick, 0, reinterpret_cast<std::uint64_t>(brick)});
      number = all_.size();
    }
    return number;
  }
  void add(std::size_t number, std::uint64_t samples) {
    if (number > 0) all_[number - 1].samples += samples;
  }
  std::vector<Need>& all() { return all_; }

 private:
  const BrickLookup& bricks_;
  Int3 grid_;
  FlatMap<std::size_t> numbers_;
  std::vector<Need> all_;
};

void put_box(const Box3& box, BrickBox& to) {
  const Int3 grid = box.extent();
  for (int axis = 0; axis < 3; ++axis) {
    to.first[axis] = static_cast<std::int32_t>(box.lo[axis]);
    to.count[axis] = static_cast<std::int32_t>(grid[axis]);
  }
}

}  // namespace

void locate_bricks(const Lattice& lattice, std::span<const Int3> tiles, const BrickLookup& bricks,
                   const BrickTable& table) {
  const std::size_t of_tile = max_bricks_of_tile(lattice, kFirstCorners);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const Box3 around = bricks_around(lattice, kFirstCorners, tiles[i]);
    put_box(around, table.boxes[i]);
    std::uint64_t* address = table.addresses.data() + i * of_tile;
    for_each_point(around,
                   [&](Int3 b) { *address++ = reinterpret_cast<std::uint64_t>(bricks.find(b)); });
  }
}

BrickUse use_bricks(const Lattice& lattice, Index reach, std::span<const TileWork> tiles,
                    const BrickLookup& bricks, std::size_t places, const std::byte* device,
                    const BrickTable& table) {
  const std::size_t of_tile = max_bricks_of_tile(lattice, reach);
  Needs needs(bricks, lattice.bricks(), tiles.size());
  // Until it is known which bricks are sent, the table holds their numbers.
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const Box3 around = bricks_around(lattice, reach, tiles[i].tile);
    const Int3 grid = around.extent();
    std::uint64_t* addresses = table.addresses.data() + i * of_tile;
    std::fill_n(addresses, volume(grid), 0);
    put_box(around, table.boxes[i]);
    for_each_needed_box(lattice, tiles[i], reach, [&](Box3 box) {
      for_each_point(lattice.bricks_of(box), [&](Int3 b) {
        // Boxes of a tile mostly share their bricks.
        std::uint64_t& number = addresses[linear_index(b - around.lo, grid)];
        if (number == 0) number = needs.number_of(b);
        const Box3 part = intersect(box, lattice.full_brick_box(b));
        needs.add(number, static_cast<std::uint64_t>(volume(part.extent())));
      });
    });
  }
  BrickUse use;
  for (Need& need : needs.all()) {
    if (use.sent.size() < places &&
        2 * need.samples >= static_cast<std::uint64_t>(volume(lattice.brick))) {
      need.address =
          reinterpret_cast<std::uint64_t>(device) + use.sent.size() * lattice.brick_bytes();
      use.sent.push_back({need.brick});
    } else {
      use.read_bytes += need.samples * lattice.sample_bytes();
    }
  }
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const std::int32_t* n = table.boxes[i].count;
    std::uint64_t* addresses = table.addresses.data() + i * of_tile;
    for (std::int32_t k = 0; k < n[0] * n[1] * n[2]; ++k)
      if (addresses[k] > 0) addresses[k] = needs.all()[addresses[k] - 1].address;
  }
  return use;
}

}  // namespace isobrick::gpu
