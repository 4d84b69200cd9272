#include <sys/mman.h>

#include <cerrno>
#include <cstdint>

#include "isobrick/core/error.h"
#include "isobrick/gpu/host_memory.h"
#include "isobrick/gpu/stream.h"

namespace isobrick::gpu {
namespace {

constexpr std::size_t kPage = 4096, kLargePage = std::size_t{2} << 20;

}  // namespace

PinnedMemory::PinnedMemory(std::size_t bytes) {
  if (bytes == 0) return;
  // What is small shares a page with nothing: one is enough.
  const std::size_t align = bytes < kLargePage ? kPage : kLargePage;
  const std::size_t locked = (bytes + kPage - 1) / kPage * kPage;
  mapped_ = locked + align;
  mapping_ = mmap(nullptr, mapped_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (mapping_ == MAP_FAILED) {
    mapping_ = nullptr;
    throw system_error("cannot get page-locked memory", "mmap", errno);
  }
  const auto first = reinterpret_cast<std::uintptr_t>(mapping_);
  void* data = reinterpret_cast<void*>((first + align - 1) / align * align);
  if (align == kLargePage) (void)madvise(data, locked, MADV_HUGEPAGE);
  // Touched before: while the driver locks pages, others wait for the driver.
  for (std::size_t at = 0; at < locked; at += kPage) static_cast<volatile char*>(data)[at] = 0;
  const cudaError_t result = cudaHostRegister(data, locked, cudaHostRegisterMapped);
  if (result != cudaSuccess) {
    (void)munmap(mapping_, mapped_);
    check(result);
  }
  data_ = data;
}

PinnedMemory::~PinnedMemory() {
  if (data_) (void)cudaHostUnregister(data_);
  if (mapping_) (void)munmap(mapping_, mapped_);
}

std::shared_ptr<std::byte> host_memory(int device, std::size_t bytes) {
  check(cudaSetDevice(device));
  const auto memory = std::make_shared<PinnedMemory>(bytes);
  return {memory, static_cast<std::byte*>(memory->data())};
}

}  // namespace isobrick::gpu
