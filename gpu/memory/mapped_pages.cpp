#include "gpu/memory/mapped_pages.h"

#include <sys/mman.h>

#include <cerrno>
#include <cstdint>

#include <isobrick/error.h>

namespace isobrick::inline v0::gpu {

MappedPages::MappedPages(std::size_t bytes) : bytes_(whole_pages(bytes)) {
  if (bytes == 0) return;
  const std::size_t align = bytes < kLargePage ? kPage : kLargePage;
  mapped_ = bytes_ + align;
  mapping_ = mmap(nullptr, mapped_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (mapping_ == MAP_FAILED) throw system_error("cannot get pinned memory", "mmap", errno);
  const auto first = reinterpret_cast<std::uintptr_t>(mapping_);
  data_ = static_cast<std::byte*>(mapping_) + ((first + align - 1) / align * align - first);
  if (align == kLargePage) (void)madvise(data_, bytes_, MADV_HUGEPAGE);
}

MappedPages::~MappedPages() {
  if (data_) (void)munmap(mapping_, mapped_);
}

}  // namespace isobrick::gpu
