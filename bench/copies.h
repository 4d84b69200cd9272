#pragma once

#include <cstdint>

namespace isobrick::bench {

/// Seconds to copy `bytes` bytes between pinned host memory and the device, in pieces of `piece`
/// bytes.
double copy_seconds(std::uint64_t bytes, std::uint64_t piece, bool to_device);

}  // namespace isobrick::bench
