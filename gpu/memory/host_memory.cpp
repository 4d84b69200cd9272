#include "gpu/memory/host_memory.h"

#include "gpu/memory/pinned_buffer.h"

namespace isobrick::inline v0::gpu {

std::shared_ptr<std::byte> host_memory(int device, std::size_t bytes) {
  make_current(device);
  const auto memory = std::make_shared<PinnedBuffer<std::byte>>(bytes);
  return {memory, memory->data()};
}

}  // namespace isobrick::gpu
