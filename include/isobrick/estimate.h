#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <isobrick/api.h>
#include <isobrick/extract.h>

namespace isobrick::inline v0 {

/// What of a level the isovalue touches, from the ranges alone. Of a capped surface also what lies
/// at the border with a sample inside.
struct ActiveParts {
  std::uint64_t bricks = 0;         ///< all of the level
  std::uint64_t active_bricks = 0;  ///< with a block that is stabbed
  std::uint64_t active_blocks = 0;  ///< stabbed blocks of 16³ cells
  std::uint64_t active_cells = 0;   ///< cells of those blocks, in the region
  Box3 bounds;                      ///< of these cells
};

/// Counts the active parts of one level. Throws as extract() does for options that make no sense.
ISOBRICK_API ActiveParts count_active(const StoreReader& store, const ExtractOptions& options);
/// The same of each of several isovalues, instead of that of the options. Reads the ranges once.
ISOBRICK_API std::vector<ActiveParts> count_active(const StoreReader& store,
                                                   const ExtractOptions& options,
                                                   std::span<const double> isovalues);

/// What no mesh in these parts exceeds; real ones are mostly some ten times smaller.
ISOBRICK_API MeshSize largest_mesh(const ActiveParts& active,
                                   Topology topology = Topology::consistent, bool cap = false);

/// What an extraction will need.
struct ExtractEstimate {
  ActiveParts active;        ///< what the isovalue touches
  MeshSize mesh;             ///< predicted
  double uncertainty = 0;    ///< two standard errors of `mesh`, as a fraction of it
  std::uint64_t memory = 0;  ///< bytes that the extraction will hold, within the budget
};

/// Counts the surface in up to 64 cubes of 64³ cells, spread evenly over the
/// active ones, and scales it to all. Reads and decodes at most 32 MiB of
/// bricks, or those of 4 cubes where that is more, within the memory budget;
/// deterministic, also over thread counts. `sink_bytes` is the MeshSink::memory() of the sink
/// that the mesh will go to. Throws as extract() does.
ISOBRICK_API ExtractEstimate estimate(const StoreReader& store, const ExtractOptions& options,
                                      std::uint64_t sink_bytes);

}  // namespace isobrick
