#pragma once

#include <cstddef>
#include <memory>

namespace isobrick::gpu {

/// Page-locked host memory, which the device may read as well. From any thread; throws Error
/// when there is none.
std::shared_ptr<std::byte> host_memory(int device, std::size_t bytes);

}  // namespace isobrick::gpu
