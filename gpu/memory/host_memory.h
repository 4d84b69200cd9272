#pragma once

#include <cstddef>
#include <memory>

namespace isobrick::inline v0::gpu {

/// A PinnedBuffer of bytes, without a CUDA header. From any thread; throws Error where the host has
/// no room.
std::shared_ptr<std::byte> host_memory(int device, std::size_t bytes);

}  // namespace isobrick::gpu
