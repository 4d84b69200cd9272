#pragma once

#include <cuda_runtime_api.h>

#include "isobrick/core/scalar.h"
#include "isobrick/gpu/kernel_graph.h"
#include "isobrick/gpu/tile_params.h"
#include "isobrick/surface/surface_options.h"

namespace isobrick::gpu {

/// Which kernel makes a surface.
struct TileKernel {
  ScalarType type;
  bool normals = false;
  bool may_have_nan = false;  ///< of f32 only
};
inline TileKernel kernel_of(ScalarType type, const SurfaceOptions& options) {
  return {type, options.normals, options.may_have_nan && is_floating(type)};
}

/// How many blocks, and how many threads each; no blocks where one does not fit.
struct LaunchShape {
  int blocks = 0, threads = 0, slabs = 1;
  std::size_t shared_bytes = 0;  ///< of each
  std::uint32_t listed = 0;      ///< cells of a tile; fuller tiles are listed in turns
  int processors = 0;            ///< that the blocks are dealt out to
  bool may_start_early = false;  ///< the code that runs waits for the launch before it
};

/// What fills the current device: the fewer tiles there are, the more threads share
/// one.
struct LaunchShapes {
  LaunchShape shapes[3];  ///< by falling number of threads
  LaunchShape slabs;      ///< of several blocks a tile; no blocks where there is none

  /// For so many tiles, a block each, in which so many active cells are expected. Where most
  /// would be listed in turns, which takes a third longer, teams that list more are better.
  LaunchShape of(std::uint32_t tiles, std::uint64_t cells = 0) const;
  /// The same where the host has found the tiles: with several to a tile if each can have a slab
  /// for itself.
  LaunchShape in_slabs(std::uint32_t tiles) const;
};

/// `threads` that share a tile: 0 chooses. Throws UsageError for numbers that have no
/// kernels, Error where no kernel fits the device.
LaunchShapes launch_shapes(const TileKernel& kernel, int threads = 0);

/// Launches the extraction of all items on `stream`: one block takes one tile
/// after the other, in their order. After a search, which finds them, blocks start while it is
/// at work. With a graph it is launched through that.
void launch_extraction(const TileKernel& kernel, const TileParams& params, const CaseTable* cases,
                       LaunchShape shape, cudaStream_t stream, bool after_search = false,
                       KernelGraph* graph = nullptr);

}  // namespace isobrick::gpu
