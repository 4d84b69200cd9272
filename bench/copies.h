#pragma once

#include <cstdint>

namespace isobrick::bench {

/// Seconds to copy so many bytes between page-locked host memory and the device, in pieces.
double copy_seconds(std::uint64_t bytes, std::uint64_t piece, bool to_device);

}  // namespace isobrick::bench
