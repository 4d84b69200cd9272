#pragma once

#include <cstddef>

#include "isobrick/pipeline/extract.h"
#include "isobrick/stream/block_search.h"
#include "isobrick/surface/cpu_extractor.h"

namespace isobrick {

class GpuSession;

/// How an extraction divides its memory budget.
struct ExtractPlan {
  ExtractorLimits limits;  ///< of the CPU's extractor; tiles: of a batch on any
  std::size_t cache_bricks = 0;
  std::size_t batch_bricks = 0;  ///< that a batch may need
  std::uint64_t bytes = 0;       ///< all of it, the program itself included
};

/// What the options say of the store's level, checked.
struct ExtractRequest {
  const LevelInfo* level = nullptr;
  SurfaceOptions surface;
  int threads = 1;
  SearchBy search;                     ///< for its active blocks
  std::uint64_t search_memory = 0;     ///< that such a search takes
  std::uint64_t memory_of_others = 0;  ///< see ExtractOptions
};

/// Throws UsageError for a level, region or isovalue that makes no sense, and for
/// an index that the store lacks.
ExtractRequest check_request(const StoreReader& store, const ExtractOptions& options,
                             Indexing indexing);

/// The least budget that plan_memory() takes.
std::uint64_t least_memory(const ExtractRequest& request, std::uint64_t other_bytes);

/// `active_bricks` bounds what a cache can use, `other_bytes` are the sink's (MeshSink::memory())
/// and those of decoding beyond the usual (decode_extra()). Throws UsageError naming the least
/// budget that works when this one does not.
ExtractPlan plan_memory(const ExtractRequest& request, std::uint64_t budget,
                        std::uint64_t active_bricks, std::uint64_t other_bytes);

/// The same where a GPU makes the surface, whose buffers `gpu` plans: page-locked memory
/// and what its driver takes are within the budget.
ExtractPlan plan_gpu_memory(const ExtractRequest& request, const ExtractOptions& options,
                            std::uint64_t active_bricks, std::uint64_t other_bytes,
                            GpuSession& gpu);

}  // namespace isobrick
