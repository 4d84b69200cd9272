#pragma once

#include <cstdint>

namespace isobrick::inline v0 {

/// How long a stage was busy, and with how many bytes. What all cores share (read and
/// decode) counts the time of every thread, divided by their number.
struct StageReport {
  double seconds = 0;       ///< busy time
  std::uint64_t bytes = 0;  ///< bytes that passed
};

/// What making a surface took, on any backend.
struct SurfaceReport {
  std::uint64_t triangles = 0;             ///< of the mesh
  std::uint64_t vertices = 0;              ///< of the mesh
  std::uint64_t degenerate_triangles = 0;  ///< left out, with drop_degenerate
  StageReport upload;                      ///< GPU: bricks or tile blocks sent to the device
  StageReport gather;                      ///< GPU: samples that the device read where they lie
  StageReport kernel;                      ///< GPU: samples in device memory, and the mesh
  StageReport download;                    ///< GPU: the mesh
  StageReport surface;                     ///< CPU: samples; the GPU has no such stage
  StageReport sink;                        ///< the mesh
  std::uint64_t device_bytes = 0;          ///< device memory that was held
  std::uint64_t pinned_bytes = 0;          ///< pinned host memory that was held
  std::uint64_t launches = 0;              ///< of kernels
  std::uint64_t repeats = 0;               ///< of those, because a mesh did not fit its buffers
};

}  // namespace isobrick
