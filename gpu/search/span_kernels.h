#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstdint>

#include "index/index_format.h"

// The launches of a search in indices that lie in device memory. Answers are bits
// of a mask of 32-bit words: item i is bit i & 31 of word i >> 5.

namespace isobrick::inline v0::gpu {

/// Threads of a block that searches; a power of two.
inline constexpr int kSearchThreads = 256;

/// Ids that lie one after the other, all of them stabbed.
struct Run {
  const std::uint32_t* ids;
  std::uint32_t n;
};

/// Long lists that all warps copy together after the search. There is room for
/// all that a sound index can have.
struct RunQueue {
  static constexpr std::uint32_t kRun = 1024;  ///< ids of a run at most
  static std::uint32_t room_for(std::uint32_t stored) { return 2 * (stored / kRun) + 1; }

  Run* runs;
  std::uint32_t* count;
  std::uint32_t room;
};

/// One of several indices of a kind and type.
struct IndexPlace {
  std::uint64_t block;       ///< offset of its bytes
  std::uint64_t first_word;  ///< of its mask
};

/// A range of the mask that belongs to one index.
struct MaskRange {
  static constexpr std::uint32_t kWords = 1024;  ///< at most

  std::uint64_t first_word;
  std::uint32_t words;
  std::uint32_t first_id;  ///< of its first bit
};

/// Searches one index with the whole device. `block` of the view is in device
/// memory; the mask is zeroed. `later` is used by quadtrees only; its count is 0.
void launch_search_one(const IndexView& index, double isovalue, std::uint32_t* mask,
                       const RunQueue& later, cudaStream_t stream);

/// Searches `count` indices of the kind and type of `like`, none of which has more
/// than `max_items`: blocks of threads for each.
void launch_search_many(const IndexView& like, const std::byte* blocks, const IndexPlace* places,
                        std::uint32_t count, std::uint32_t max_items, double isovalue,
                        std::uint32_t* mask, cudaStream_t stream);

/// The number of bits that are set in each range, and the sum of those before it:
/// `first` has one more, the sum of all. So has `counts`, a 0.
void launch_count_bits(const std::uint32_t* mask, const MaskRange* ranges, std::uint32_t count,
                       std::uint32_t* counts, std::uint32_t* first, cudaStream_t stream);

/// Writes the ids of the set bits ascending, those of range i from first[i] on;
/// none at `room` or above.
void launch_list_bits(const std::uint32_t* mask, const MaskRange* ranges, std::uint32_t count,
                      const std::uint32_t* first, std::uint32_t* ids, std::uint64_t room,
                      cudaStream_t stream);

}  // namespace isobrick::gpu
