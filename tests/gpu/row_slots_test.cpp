#include "gpu/stream/row_slots.h"

#include <gtest/gtest.h>

#include <map>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "core/morton.h"
#include "gpu/stream/stream_sizes.h"

namespace isobrick::testing {
namespace {

// The worst case: the surface passes every tile.
TEST(RowSlots, StreamSizesHaveEnoughForEveryGrid) {
  for (const Int3 grid : {Int3{32, 32, 32}, Int3{33, 33, 33}, Int3{17, 17, 17}, Int3{64, 64, 8},
                          Int3{8, 64, 64}, Int3{64, 8, 64}, Int3{100, 3, 50}, Int3{1, 1, 200},
                          Int3{200, 2, 2}, Int3{40, 70, 20}, Int3{1, 90, 90}})
    for (const auto& [tiles, in_flight] :
         {std::pair{1u, 2}, std::pair{7u, 2}, std::pair{256u, 4}}) {
      SCOPED_TRACE(std::to_string(grid.x) + "x" + std::to_string(grid.y) + "x" +
                   std::to_string(grid.z) + ", launches of " + std::to_string(tiles));
      const Lattice lattice{grid * kTileEdge, {64, 64, 64}, ScalarType::u8};
      gpu::RowSlots slots(
          gpu::stream_sizes(lattice, {.roi = lattice.box()}, tiles, in_flight).slots, grid);
      std::vector<std::vector<std::uint32_t>> unused(static_cast<std::size_t>(in_flight));
      std::size_t launch = 0;
      std::uint32_t in_launch = 0;
      Int3 last{};
      const auto end_launch = [&] {
        slots.end_launch(last, unused[launch % unused.size()]);
        in_launch = 0;
        ++launch;
        slots.recycle(unused[launch % unused.size()]);
      };
      ASSERT_NO_THROW(for_each_morton(grid, [&](Int3 tile) {
        slots.add(tile);
        last = tile;
        if (++in_launch == tiles) end_launch();
      }));
    }
}

TEST(RowSlots, ATileIsFoundUntilItsLastAskerIsDone) {
  const Int3 grid{2, 2, 2};
  gpu::RowSlots slots(8, grid);
  std::vector<std::uint32_t> unused;
  const std::uint32_t first = slots.add({0, 0, 0});
  EXPECT_EQ(slots.find({0, 0, 0}), first | gpu::TileLinks::kSameLaunch);
  EXPECT_EQ(slots.find({1, 0, 0}), gpu::kNone);
  slots.end_launch({0, 0, 0}, unused);
  EXPECT_TRUE(unused.empty());
  EXPECT_EQ(slots.find({0, 0, 0}), first);
  const std::uint32_t last = slots.add({1, 1, 1});
  slots.end_launch({1, 1, 1}, unused);
  EXPECT_EQ(unused, (std::vector{first, last}));
  EXPECT_EQ(slots.find({0, 0, 0}), gpu::kNone);
}

// Beside bookkeeping of the simplest kind, over tiles here and there.
TEST(RowSlots, EachNeighbourIsFoundWithItsSlot) {
  const Int3 grid{13, 9, 10};
  gpu::RowSlots slots(static_cast<std::uint32_t>(volume(grid)), grid);
  struct Known {
    std::uint32_t slot;
    int launch;
    std::uint64_t last_user;
  };
  std::map<std::uint64_t, Known> known;  // by code
  std::vector<std::uint32_t> unused;
  std::mt19937 random(1);
  int launch = 0, in_launch = 0;
  for_each_morton(grid, [&](Int3 tile) {
    if (random() % 3 == 0) return;
    for (int n = 1; n <= 6; ++n) {
      const Int3 neighbour = tile - Int3{n & 1, n >> 1 & 1, n >> 2};
      if (neighbour.x < 0 || neighbour.y < 0 || neighbour.z < 0) continue;
      const auto found = known.find(morton_encode(neighbour));
      const std::uint32_t expected =
          found == known.end()
              ? gpu::kNone
              : found->second.slot |
                    (found->second.launch == launch ? gpu::TileLinks::kSameLaunch : 0);
      EXPECT_EQ(slots.find(neighbour), expected);
    }
    const Int3 one{1, 1, 1};
    known[morton_encode(tile)] = {slots.add(tile), launch,
                                  morton_encode(min(tile + one, grid - one))};
    if (++in_launch < 11) return;
    slots.end_launch(tile, unused);
    std::multiset<std::uint32_t> expected;
    std::erase_if(known, [&](const auto& entry) {
      const bool over = entry.second.last_user <= morton_encode(tile);
      if (over) expected.insert(entry.second.slot);
      return over;
    });
    EXPECT_EQ(std::multiset(unused.begin(), unused.end()), expected);
    slots.recycle(unused);
    in_launch = 0;
    ++launch;
  });
  EXPECT_GT(launch, 50);
}

}  // namespace
}  // namespace isobrick::testing
