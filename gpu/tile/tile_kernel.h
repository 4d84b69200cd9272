#pragma once

#include <cuda_runtime_api.h>

#include <isobrick/scalar.h>
#include <isobrick/surface_options.h>
#include "gpu/tile/on_samples.h"
#include "gpu/tile/tile_params.h"

namespace isobrick::inline v0::gpu {

/// Which kernel makes a surface.
struct TileKernel {
  ScalarType type;
  bool normals = false;
  bool may_have_nan = false;  ///< of f32 and f64 only
  bool on_samples = false;    ///< makes vertices on samples
  bool trilinear = false;
};
inline TileKernel kernel_of(ScalarType type, const SurfaceOptions& given) {
  const SurfaceOptions options = options_that_matter(type, given);
  return {type, options.normals, options.may_have_nan, has_samples(options),
          options.topology == Topology::trilinear};
}

/// A kernel as it is launched: the number of its thread blocks that fill the device and their size.
struct LaunchShape {
  int blocks = 0;                ///< 0: the device has too little shared memory for one
  int threads = 0;               ///< of a block
  std::size_t shared_bytes = 0;  ///< of a block
  std::uint32_t listed = 0;      ///< cells of a tile; fuller tiles are listed in several rounds
  /// Launches the kernel on a stream.
  void (*launch)(const LaunchShape& shape, const TileParams& params, const CaseTable* cases,
                 cudaStream_t stream) = nullptr;
};

/// The shapes of a kernel on the current device: the fewer tiles there are, the more threads share
/// one.
struct LaunchShapes {
  LaunchShape shapes[3];  ///< by falling number of threads

  /// For so many tiles, a block each, in which so many active cells are expected. Where most
  /// would be listed in several rounds, which takes a third longer, larger blocks are better.
  const LaunchShape& of(std::uint32_t tiles, std::uint64_t cells = 0) const;
};

/// Of a kernel that makes vertices on samples.
LaunchShape on_samples_shape(ScalarType type, bool normals);

/// Of a kernel that follows the trilinear interpolant.
LaunchShape trilinear_shape(ScalarType type, bool normals, bool may_have_nan);

/// Of a kernel that does both.
LaunchShape trilinear_on_samples_shape(ScalarType type, bool normals);

/// Throws Error where no kernel fits the device.
LaunchShapes launch_shapes(const TileKernel& kernel);

}  // namespace isobrick::gpu
