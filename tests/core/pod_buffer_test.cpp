#include <isobrick/pod_buffer.h>

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <memory_resource>
#include <new>

namespace isobrick::inline v0 {
namespace {

constexpr std::size_t kMost = std::numeric_limits<std::size_t>::max();

// The bytes of 2⁶¹ + 1 numbers of eight are eight in 64 bits.
TEST(PodBuffer, SizesWhoseBytesWrapAreRefused) {
  for (std::pmr::memory_resource* memory :
       {static_cast<std::pmr::memory_resource*>(nullptr), std::pmr::new_delete_resource()}) {
    PodBuffer<std::uint64_t> buffer(memory);
    buffer.resize(3);
    buffer[2] = 42;
    for (const std::size_t size : {kMost / 8 + 2, kMost / 8, kMost / 16 + 1, kMost}) {
      EXPECT_THROW(buffer.reserve(size), std::bad_alloc) << size;
      EXPECT_THROW(buffer.resize(size), std::bad_alloc) << size;
    }
    EXPECT_EQ(buffer.size(), 3u);
    EXPECT_EQ(buffer[2], 42u);
  }
}

TEST(PodBuffer, AFailedGrowthKeepsWhatItHolds) {
  PodBuffer<std::uint8_t> buffer;
  buffer.resize(2 * detail::kLargeMemory);
  *(buffer.end() - 1) = 42;
  EXPECT_THROW(buffer.reserve(kMost / 4), std::bad_alloc);
  EXPECT_EQ(buffer.size(), 2 * detail::kLargeMemory);
  EXPECT_EQ(*(buffer.end() - 1), 42);
  buffer.resize(5 * detail::kLargeMemory);
  EXPECT_EQ(buffer[2 * detail::kLargeMemory - 1], 42);
}

}  // namespace
}  // namespace isobrick
