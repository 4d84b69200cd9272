#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <isobrick/extract.h>
#include "stream/block_search.h"
#include "surface/cpu_extractor.h"

namespace isobrick::inline v0 {

class GpuSession;

/// How an extraction divides its memory budget.
struct ExtractPlan {
  ExtractorLimits limits;  ///< of each extractor on the CPU; tiles: of a batch on any
  std::size_t cache_bricks = 0;
  std::size_t batch_bricks = 0;  ///< that a batch may need
  std::size_t sinks = 1;         ///< that a resident pass writes at a time
  std::uint64_t bytes = 0;       ///< all of it, the program itself included
};

/// A part of a mesh that is made alone.
struct RequestedPart {
  TileRange tiles;
  TilePlaces* places = nullptr;     ///< hears where its tiles lie
  std::uint64_t active_blocks = 0;  ///< of its own tiles
};

/// The options for the store's level, checked.
struct ExtractRequest {
  const LevelInfo* level = nullptr;
  SurfaceOptions surface;
  bool packed = false;  ///< are the level's bricks
  int threads = 1;
  SearchMethod search;                 ///< for its active blocks
  std::uint64_t search_memory = 0;     ///< that such a search takes
  std::uint64_t memory_of_others = 0;  ///< see ExtractOptions
  std::uint64_t sink_bytes = 0;        ///< MeshSink::memory() of its sink
  std::uint64_t active_bricks = 0;     ///< bounds what a cache can use
  std::optional<RequestedPart> part;   ///< nothing: the whole mesh
};

/// Throws UsageError for a level, region or isovalue that makes no sense, and for
/// an index that the store lacks.
ExtractRequest check_request(const StoreReader& store, const ExtractOptions& options,
                             Indexing indexing);

/// Surfaces that are made in one pass over the bricks. They differ in their SurfaceOptions only,
/// and not in the region.
using PassRequests = std::span<const ExtractRequest>;

/// The search for the blocks of capped surfaces; nothing for others.
std::optional<CapSearch> cap_search(const SurfaceOptions& surface);

/// The isovalues of a pass, each once.
std::vector<double> isovalues_of(PassRequests requests);
/// Layers of samples around a tile that any of the surfaces needs.
Index reach_of(PassRequests requests);

/// What the program takes, and reading bricks of a level on so many threads, beside the bricks
/// themselves.
std::uint64_t reading_bytes(const LevelInfo& level, int threads);

/// The least budget that plan_memory() takes.
std::uint64_t least_memory(PassRequests requests, std::uint64_t other_bytes);

/// How many of the first surfaces one pass makes within the budget; one at least.
std::size_t surfaces_of_pass(PassRequests requests, std::uint64_t budget,
                             std::uint64_t other_bytes);

/// `other_bytes` are those of decoding beyond the usual (decode_extra()) and of sinks that wait.
/// Throws UsageError naming the least budget that works when this one does not.
ExtractPlan plan_memory(PassRequests requests, std::uint64_t budget, std::uint64_t other_bytes);

/// The same where a GPU makes the surfaces, whose buffers `gpu` plans: page-locked memory
/// and what its driver takes are within the budget.
ExtractPlan plan_gpu_memory(PassRequests requests, const ExtractOptions& options,
                            std::uint64_t other_bytes, GpuSession& gpu);

/// The same for surfaces that are made one after the other from samples kept on a GPU
/// (resident_pass.h). `other_bytes` includes those of loading them. `limits.output_bytes` are those
/// of a pinned buffer, of which there are two. None where the budget is too small.
std::optional<ExtractPlan> plan_resident_memory(PassRequests requests, std::uint64_t budget,
                                                std::uint64_t other_bytes);
/// The least budget for it, with so many sinks at a time.
std::uint64_t least_resident_memory(PassRequests requests, std::uint64_t other_bytes,
                                    std::size_t sinks = 1);

}  // namespace isobrick
