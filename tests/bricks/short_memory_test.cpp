#include <gtest/gtest.h>

#include <cstdlib>
#include <new>

#include "bricks/store_writer.h"
#include "tests/bricks/store_fixture.h"

namespace {

/// Allocations of this thread until one fails; negative: none does.
thread_local long g_left = -1;

void* allocate(std::size_t size) {
  if (g_left >= 0 && g_left-- == 0) throw std::bad_alloc();
  if (void* const memory = std::malloc(size > 0 ? size : 1)) return memory;
  throw std::bad_alloc();
}

}  // namespace

void* operator new(std::size_t size) { return allocate(size); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace isobrick::test {
namespace {

TEST(ShortMemory, AWriterSurvivesWhicheverAllocationFails) {
  const std::vector<Level> levels{make_level(ScalarType::u8, {40, 36, 33}, 16, 32, 3, false)};
  const std::vector<std::byte> brick(100);
  bool whole = false;
  for (long failing = 0; !whole; ++failing) {
    const TemporaryFolder folder;
    StoreWriter writer(folder / "a.zarr", make_layout(levels, 3, 3), false);
    const std::string name = (folder / "a.zarr").string();
    g_left = failing;
    try {
      writer.put(0, {0, 0, 0}, brick);
      writer.finish_shard(0, {0, 0, 0});
      whole = true;
    } catch (const std::bad_alloc&) {
    }
    g_left = -1;
    // What is there is still of use, and the writer goes as it came.
    if (!whole) {
      EXPECT_NO_THROW(writer.finish_shard(0, {1, 0, 0}));
    }
    ASSERT_LT(failing, 1000);
  }
}

}  // namespace
}  // namespace isobrick::test
