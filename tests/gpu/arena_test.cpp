#include "gpu/memory/arena.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>

namespace isobrick::inline v0::gpu {
namespace {

TEST(Arena, SlicesFollowEachOtherAligned) {
  alignas(Arena::kAlign) std::array<std::byte, 1024> buffer;
  Arena arena(buffer.data(), buffer.size());
  EXPECT_EQ(arena.take<std::byte>(1), buffer.data());
  EXPECT_EQ(arena.used(), 1);
  auto* const numbers = arena.take<std::uint32_t>(3);
  EXPECT_EQ(reinterpret_cast<std::byte*>(numbers), buffer.data() + Arena::kAlign);
  EXPECT_EQ(arena.used(), Arena::kAlign + 12);
  EXPECT_EQ(arena.take<std::byte>(512), buffer.data() + 512) << "up to the last byte";
  EXPECT_THROW(arena.take<std::byte>(1), Error);
}

TEST(Arena, RefusesWhatDoesNotFit) {
  std::array<std::byte, 300> buffer;
  Arena arena(buffer.data(), buffer.size());
  EXPECT_THROW(arena.take<std::byte>(301), Error);
  EXPECT_THROW(arena.take<std::uint64_t>(~std::size_t{0} / 4), Error) << "the size overflows";
  EXPECT_EQ(arena.take<std::byte>(300), buffer.data()) << "a refusal takes nothing";
  EXPECT_THROW(arena.take<std::byte>(0), Error) << "the next slice would begin behind the end";
}

TEST(Arena, PacksWhatNeedsNoAlignment) {
  std::array<std::byte, 10> buffer;
  Arena arena(buffer.data(), buffer.size(), 1);
  EXPECT_EQ(arena.take<std::byte>(3), buffer.data());
  EXPECT_EQ(arena.take<std::byte>(7), buffer.data() + 3);
}

TEST(Arena, MeasuresWithoutABuffer) {
  Arena measure;
  measure.take<std::byte>(257);
  measure.take<double>(2);
  EXPECT_EQ(measure.used(), 2 * Arena::kAlign + 16);
}

}  // namespace
}  // namespace isobrick::gpu
