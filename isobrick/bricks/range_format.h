#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "isobrick/bricks/array_metadata.h"
#include "isobrick/bricks/range_table.h"
#include "isobrick/core/lattice.h"

// The bytes of a range array: pairs (lo, hi) of the level's type in chunks of kRangeChunkEdge³
// items, C order [z, y, x, 2], and the checksums of all chunks. No files here.

namespace isobrick {

inline constexpr Int3 kRangeChunkExtent{kRangeChunkEdge, kRangeChunkEdge, kRangeChunkEdge};

/// The array [z, y, x, 2] of the ranges of so many items.
ArrayMetadata range_array_metadata(Int3 items, ScalarType type);

/// Bytes of a decoded chunk.
std::size_t range_chunk_bytes(ScalarType type);

/// The checksum that an encoded chunk ends with; 0 when it has none.
std::uint32_t range_chunk_checksum(std::span<const std::byte> encoded);

/// Copies pairs from `box` (C order) to a decoded chunk: those of `part`, which is in both.
void pack_ranges(ScalarType type, Box3 box, std::span<const std::byte> pairs, Int3 chunk, Box3 part,
                 std::span<std::byte> decoded);

/// Reads the ranges of `part` from a decoded chunk into the table.
void unpack_ranges(ScalarType type, std::span<const std::byte> decoded, Int3 chunk, Box3 part,
                   RangeTable& table);

/// The file of checksums: one of each chunk, then the checksum of those.
std::vector<std::uint32_t> with_own_checksum(std::vector<std::uint32_t> checksums);
/// The same backwards; nullopt for bytes that are no such file of `chunks` checksums.
struct ChunkChecksums {
  std::vector<std::uint32_t> chunks;
  std::uint32_t own = 0;
};
std::optional<ChunkChecksums> parse_range_checksums(std::span<const std::byte> bytes,
                                                    std::size_t chunks);

/// Calls f(chunk coordinates, the part of the box in that chunk).
template <class F>
void for_each_range_chunk(Box3 box, F&& f) {
  constexpr Index edge = kRangeChunkEdge;
  const Int3 first{box.lo.x / edge, box.lo.y / edge, box.lo.z / edge};
  for_each_point({first, ceil_div(box.hi, kRangeChunkExtent)}, [&](Int3 c) {
    f(c, intersect(box, {c * edge, (c + Int3{1, 1, 1}) * edge}));
  });
}

}  // namespace isobrick
