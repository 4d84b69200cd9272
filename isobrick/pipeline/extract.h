#pragma once

#include <cstdint>
#include <optional>

#include "isobrick/bricks/store_reader.h"
#include "isobrick/core/progress.h"
#include "isobrick/pipeline/index_choice.h"
#include "isobrick/surface/mesh.h"

namespace isobrick {

/// Which surface, from which part of a store, and with what means.
struct ExtractOptions {
  double isovalue = 0;
  int level = 0;
  std::optional<Box3> roi;       ///< samples of that level; nothing: the whole volume
  bool normals = false;          ///< gradient normals
  bool drop_degenerate = false;  ///< see SurfaceOptions
  std::uint64_t memory = std::uint64_t{1} << 30;  ///< hard budget, bytes
  int threads = 0;                                ///< 0: all cores
  IndexChoice index;  ///< how active blocks are found; never shows in the mesh
};

/// What an extraction did.
struct ExtractReport {
  std::uint64_t triangles = 0, vertices = 0;
  std::uint64_t degenerate_triangles = 0;  ///< left out, with drop_degenerate
  std::uint64_t bricks = 0, active_bricks = 0, bricks_read = 0, brick_reads = 0;
  std::uint64_t bytes_read = 0;
  double seconds = 0, plan_seconds = 0, decode_seconds = 0, surface_seconds = 0, sink_seconds = 0;
  std::optional<IndexKind> index;  ///< that was asked for active blocks; nothing: only ranges
  std::uint64_t search_bytes = 0;  ///< read to find them, once
  double search_seconds = 0;       ///< to find them, once
};

/// Streams the isosurface of one level into `sink` (begin … finish).
/// Throws UsageError for a level, ROI or isovalue that makes no sense or a
/// budget too small for one tile with its neighbours.
ExtractReport extract(const StoreReader& store, const ExtractOptions& options, MeshSink& sink,
                      Progress& progress);

}  // namespace isobrick
