#include "stream/brick_memory.h"

#include <sys/mman.h>

#include <cstdlib>
#include <new>

namespace isobrick::inline v0 {

std::shared_ptr<std::byte> allocate_bricks(std::size_t bytes) {
  constexpr std::size_t kLargePage = std::size_t{2} << 20;
  const bool large = bytes >= kLargePage;
  const std::size_t align = large ? kLargePage : 64;
  void* const memory = std::aligned_alloc(align, (bytes + align - 1) / align * align);
  if (!memory) throw std::bad_alloc();
  if (large) (void)madvise(memory, bytes, MADV_HUGEPAGE);
  return {static_cast<std::byte*>(memory), &std::free};
}

}  // namespace isobrick
