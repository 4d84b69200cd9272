#include "gpu/memory/cuda_objects.h"
#include "gpu/memory/host_memory.h"

namespace isobrick::gpu {

PinnedMemory::PinnedMemory(std::size_t bytes) : pages_(bytes) {
  if (bytes == 0) return;
  MappedPages::touch(pages_.data(), pages_.bytes());
  check(cudaHostRegister(pages_.data(), pages_.bytes(), cudaHostRegisterMapped));
  locked_ = true;
}

PinnedMemory::~PinnedMemory() {
  if (locked_) (void)cudaHostUnregister(pages_.data());
}

std::shared_ptr<std::byte> host_memory(int device, std::size_t bytes) {
  check(cudaSetDevice(device));
  const auto memory = std::make_shared<PinnedMemory>(bytes);
  return {memory, static_cast<std::byte*>(memory->data())};
}

}  // namespace isobrick::gpu
