#pragma once

#include <cstdint>

namespace isobrick::inline v0 {

/// How the bricks of a store are compressed, always without loss.
enum class BrickCodec : std::uint8_t {
  none,    ///< not at all
  zstd,    ///< which every program that reads Zarr 3 knows
  packed,  ///< differences packed in bits: decoded many times faster, but only by Isobrick
};

}  // namespace isobrick
