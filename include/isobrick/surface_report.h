#pragma once

#include <cstdint>

namespace isobrick {

/// How long a stage was busy, and with how many bytes. What all cores share (read and
/// decode) counts the time of every thread, divided by their number.
struct StageReport {
  double seconds = 0;
  std::uint64_t bytes = 0;
};

/// What making a surface took, on any backend.
struct SurfaceReport {
  std::uint64_t triangles = 0, vertices = 0;
  std::uint64_t degenerate_triangles = 0;  ///< left out, with drop_degenerate
  /// Bricks sent to the device, samples read by it where they lie, samples there; the mesh. The
  /// GPU has no stage `surface`; the CPU has only that one and `sink`.
  StageReport upload, gather, kernel, download, surface, sink;
  std::uint64_t device_bytes = 0;  ///< device memory that was held
  std::uint64_t pinned_bytes = 0;  ///< pinned host memory that was held
  std::uint64_t launches = 0;      ///< of kernels
  std::uint64_t repeats = 0;       ///< of those, because a mesh did not fit its buffers
};

}  // namespace isobrick
