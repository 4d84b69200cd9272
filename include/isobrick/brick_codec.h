#pragma once

#include <cstdint>

namespace isobrick::inline v0 {

/// How the bricks of a store are compressed, always without loss.
enum class BrickCodec : std::uint8_t {
  none,    ///< not at all
  zstd,    ///< which every program that reads Zarr 3 knows
  packed,  ///< differences packed in bits: decoded many times faster, but only by Isobrick
  /// zstd or packed: what suits the samples, of which some bricks are encoded by both before the
  /// first one is written. Never what a store has.
  automatic,
};

/// BrickCodec::automatic chooses packed where it takes at most so many times the bytes of zstd.
inline constexpr double kMaxPackedFactor = 1.1;

/// Some bricks of a volume, spread over it, as zstd and as packed. Those that hold the fill value
/// only are left out: neither codec stores them.
struct CodecSample {
  std::uint64_t bricks = 0;        ///< 0: none was found that is stored
  std::uint64_t bytes = 0;         ///< of their samples
  std::uint64_t zstd_bytes = 0;    ///< of them encoded
  std::uint64_t packed_bytes = 0;  ///< of them encoded
  double zstd_seconds = 0;         ///< of a core that decodes them
  double packed_seconds = 0;       ///< of a core that decodes them
};

}  // namespace isobrick
