#pragma once

#include <cstdint>

#include <isobrick/surface_options.h>

namespace isobrick::inline v0 {

/// Triangles that fill one border face at most.
inline constexpr int kMaxFaceTriangles = 4;

/// What the cap of one tile can take at most; nothing without SurfaceOptions::cap.
struct CapBounds {
  std::uint64_t faces = 0;     ///< border faces
  std::uint64_t vertices = 0;  ///< on samples
  std::uint64_t shared = 0;    ///< of these on planes that other tiles have as well
};
CapBounds cap_bounds(const SurfaceOptions& options);

}  // namespace isobrick
