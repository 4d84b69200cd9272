#include "isobrick/gpu/brick_table.h"

#include <algorithm>
#include <unordered_map>

namespace isobrick::gpu {
namespace {

/// What of a brick the tiles of a launch need.
struct Need {
  const std::byte* brick = nullptr;
  std::uint64_t samples = 0;  ///< what several tiles need counts for each
  std::uint64_t address = 0;
};

/// The bricks that the tile's samples, `reach` layers around included, lie in.
Box3 bricks_around(const Lattice& lattice, Index reach, Int3 tile) {
  const Index edge = kTileEdge + 1 + reach;
  const Int3 lo = tile * kTileEdge;
  return lattice.bricks_of(
      intersect({lo - Int3{reach, reach, reach}, lo + Int3{edge, edge, edge}}, lattice.box()));
}

/// Collects the bricks of a launch, each once.
class Needs {
 public:
  explicit Needs(std::size_t tiles) { numbers_.reserve(tiles); }

  /// The number of a brick.
  std::size_t add(const std::byte* brick, std::uint64_t samples) {
    const auto [at, added] = numbers_.try_emplace(brick, all_.size());
    if (added) all_.push_back({brick, 0, reinterpret_cast<std::uint64_t>(brick)});
    all_[at->second].samples += samples;
    return at->second;
  }
  std::vector<Need>& all() { return all_; }

 private:
  std::unordered_map<const std::byte*, std::size_t> numbers_;
  std::vector<Need> all_;
};

}  // namespace

BrickUse use_bricks(const Lattice& lattice, Index reach, std::span<const TileWork> tiles,
                    const BrickLookup& bricks, std::size_t places, const std::byte* device,
                    const BrickTable& table) {
  const std::size_t of_tile = max_bricks_of_tile(lattice, reach);
  Needs needs(tiles.size());
  // Until it is known which bricks are sent, the table holds their numbers, counted from 1.
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const Box3 around = bricks_around(lattice, reach, tiles[i].tile);
    const Int3 grid = around.extent();
    std::uint64_t* addresses = table.addresses.data() + i * of_tile;
    std::fill_n(addresses, volume(grid), 0);
    for (int axis = 0; axis < 3; ++axis) {
      table.boxes[i].first[axis] = static_cast<std::int32_t>(around.lo[axis]);
      table.boxes[i].count[axis] = static_cast<std::int32_t>(grid[axis]);
    }
    for_each_needed_box(lattice, tiles[i], reach, [&](Box3 box) {
      for_each_point(lattice.bricks_of(box), [&](Int3 b) {
        const std::byte* brick = bricks.find(b);
        if (!brick) return;
        const Box3 part = intersect(box, lattice.full_brick_box(b));
        addresses[linear_index(b - around.lo, grid)] =
            1 + needs.add(brick, static_cast<std::uint64_t>(volume(part.extent())));
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
