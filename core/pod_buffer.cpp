#include <isobrick/pod_buffer.h>

#include <sys/mman.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <new>

namespace isobrick::detail {
namespace {

constexpr std::size_t kLargePage = std::size_t{2} << 20;
static_assert(kLargeMemory % kLargePage == 0);
constexpr std::size_t kAlignment = 64;

std::size_t whole_pages(std::size_t bytes) {
  return (bytes + kLargePage - 1) / kLargePage * kLargePage;
}

/// Addresses for `bytes`, which begin on a large page; what lies there is not used yet.
std::byte* reserve_addresses(std::size_t bytes) {
  const std::size_t all = bytes + kLargePage;
  void* const found = mmap(nullptr, all, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (found == MAP_FAILED) throw std::bad_alloc();
  auto* const begin = static_cast<std::byte*>(found);
  const std::size_t before =
      (kLargePage - reinterpret_cast<std::uintptr_t>(begin) % kLargePage) % kLargePage;
  if (before > 0) munmap(begin, before);
  if (before < kLargePage) munmap(begin + before + bytes, kLargePage - before);
  return begin + before;
}

void* map_pages(std::size_t bytes) {
  std::byte* const place = reserve_addresses(bytes);
  if (mprotect(place, bytes, PROT_READ | PROT_WRITE) != 0) {
    munmap(place, bytes);
    throw std::bad_alloc();
  }
  (void)madvise(place, bytes, MADV_HUGEPAGE);
  return place;
}

/// Moves the pages: a place that is aligned as they are lets large pages stay whole.
void* move_pages(void* data, std::size_t old_bytes, std::size_t bytes) {
  std::byte* const place = reserve_addresses(bytes);
  void* const moved = mremap(data, old_bytes, bytes, MREMAP_MAYMOVE | MREMAP_FIXED, place);
  if (moved != MAP_FAILED) return moved;
  // mremap() may have unmapped the place before it failed, and another thread may have mapped
  // memory there since. So the addresses are left alone: they hold no memory.
  throw std::bad_alloc();
}

}  // namespace

void* grow_memory(std::pmr::memory_resource* memory, void* data, std::size_t used,
                  std::size_t old_capacity, std::size_t capacity) {
  if (!memory && capacity < kLargeMemory) {
    void* const grown = std::realloc(data, capacity);
    return grown ? grown : throw std::bad_alloc();
  }
  if (!memory && old_capacity >= kLargeMemory)
    return move_pages(data, whole_pages(old_capacity), whole_pages(capacity));
  void* const grown =
      memory ? memory->allocate(capacity, kAlignment) : map_pages(whole_pages(capacity));
  if (used > 0) std::memcpy(grown, data, used);
  free_memory(memory, data, old_capacity);
  return grown;
}

void free_memory(std::pmr::memory_resource* memory, void* data, std::size_t capacity) noexcept {
  if (!data) return;
  if (memory)
    memory->deallocate(data, capacity, kAlignment);
  else if (capacity < kLargeMemory)
    std::free(data);
  else
    munmap(data, whole_pages(capacity));
}

}  // namespace isobrick::detail
