#include "gpu/stream/brick_table.h"

#include <gtest/gtest.h>

#include <cstring>
#include <optional>

#include "core/dense_bricks.h"
#include "gpu/tile/tile_params.h"

// Host logic: whatever a kernel finds through the table is the sample that it needs.

namespace isobrick::testing {
namespace {

struct Case {
  Int3 brick;
  Index reach;
  std::size_t places;
  int active = 0xff;  ///< blocks of each tile
};

class Table {
 public:
  Table(const Lattice& lattice, const DenseBricks& bricks, const Case& c,
        std::span<const TileWork> tiles)
      : lattice_(lattice),
        of_tile_(max_bricks_of_tile(lattice, c.reach)),
        boxes_(tiles.size()),
        addresses_(tiles.size() * of_tile_),
        device_(c.places * lattice.brick_bytes()),
        use_(gpu::use_bricks(lattice, c.reach, tiles, bricks, c.places, device_.data(),
                             {boxes_, addresses_})) {
    for (std::size_t i = 0; i < use_.sent.size(); ++i)
      std::memcpy(device_.data() + i * lattice.brick_bytes(), use_.sent[i].from,
                  lattice.brick_bytes());
  }

  /// Nothing where the table leads astray.
  std::optional<std::uint16_t> sample(std::size_t tile, Int3 p) const {
    const gpu::BrickBox& box = boxes_[tile];
    Index place = 0, offset = 0;
    for (int axis = 2; axis >= 0; --axis) {
      const Index b = p[axis] / lattice_.brick[axis] - box.first[axis];
      if (b < 0 || b >= box.count[axis]) return std::nullopt;
      place = place * box.count[axis] + b;
      offset = offset * lattice_.brick[axis] + p[axis] % lattice_.brick[axis];
    }
    if (place >= static_cast<Index>(of_tile_)) return std::nullopt;
    const std::uint64_t address = addresses_[tile * of_tile_ + static_cast<std::size_t>(place)];
    if (address == 0) return std::nullopt;
    return reinterpret_cast<const std::uint16_t*>(address)[offset];
  }
  const gpu::BrickUse& use() const { return use_; }

 private:
  Lattice lattice_;
  std::size_t of_tile_;
  std::vector<gpu::BrickBox> boxes_;
  std::vector<std::uint64_t> addresses_;
  std::vector<std::byte> device_;
  gpu::BrickUse use_;
};

gpu::BrickUse look_up_all(const Case& c) {
  const Lattice lattice{{70, 66, 37}, c.brick, ScalarType::u16};
  std::vector<std::uint16_t> samples(static_cast<std::size_t>(volume(lattice.extent)));
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i] = static_cast<std::uint16_t>(i * 31);
  const DenseBricks bricks(lattice, samples.data());
  std::vector<TileWork> tiles;
  for_each_point({{0, 0, 0}, lattice.tiles()}, [&](Int3 t) {
    tiles.push_back({t, static_cast<std::uint8_t>(c.active)});
  });
  const Table table(lattice, bricks, c, tiles);
  std::uint64_t wrong = 0;
  for (std::size_t i = 0; i < tiles.size(); ++i)
    for_each_needed_box(lattice, tiles[i], c.reach, [&](Box3 box) {
      for_each_point(box, [&](Int3 p) {
        const auto expected = samples[static_cast<std::size_t>(linear_index(p, lattice.extent))];
        wrong += table.sample(i, p) != expected;
      });
    });
  EXPECT_EQ(wrong, 0u);
  return table.use();
}

TEST(BrickTable, EveryNeededSampleIsWhereTheTableSays) {
  for (const Int3 brick : {Int3{64, 64, 64}, Int3{16, 16, 16}, Int3{20, 33, 48}, Int3{128, 1, 7}})
    for (const Index reach : {0, 1})
      for (const std::size_t places : {0, 3, 1000})
        for (const int active : {0xff, 0x81}) {
          const gpu::BrickUse use = look_up_all({brick, reach, places, active});
          EXPECT_LE(use.sent.size(), places);
          if (places == 0) {
            EXPECT_GT(use.read_bytes, 0u);
          }
        }
}

TEST(BrickTable, BricksOfWhichLittleIsNeededAreNotSent) {
  EXPECT_GE(look_up_all({{32, 32, 32}, 0, 1000, 0xff}).sent.size(), 4u);
  EXPECT_TRUE(look_up_all({{64, 64, 64}, 0, 1000, 0x01}).sent.empty());
}

}  // namespace
}  // namespace isobrick::testing
