#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <isobrick/lattice.h>
#include <isobrick/range_table.h>
#include "bricks/zarr/array_metadata.h"

// The bytes of the arrays below isobrick/: one item for each brick or block, in chunks of as many
// items as a cube of kRangeChunkEdge has, C order [z, y, x], and the checksums of all chunks. No
// files here.

namespace isobrick::inline v0 {

inline constexpr Int3 kRangeChunkCube{kRangeChunkEdge, kRangeChunkEdge, kRangeChunkEdge};

/// Items of a chunk along each axis: a cube, but in thin volumes long along the long axes.
/// docs/reference/store_format.md has the rule.
Int3 range_chunk_extent(Int3 items);

/// The array [z, y, x, 2] of the ranges of so many items: pairs (lo, hi) of the
/// surface_type() of the level's type.
ArrayMetadata range_array_metadata(Int3 items, ScalarType type);

/// The array [z, y, x] of the checksums of so many bricks.
ArrayMetadata checksum_array_metadata(Int3 items);

/// Ranges of samples of a type as the array keeps them, in its surface_type(): `pairs` as they are,
/// or those of 64-bit integers in `room`.
std::span<const std::byte> stored_pairs(ScalarType type, std::span<const std::byte> pairs,
                                        std::vector<std::byte>& room);

/// Bytes of an item of such an array.
std::size_t item_bytes(const ArrayMetadata& array);

/// Bytes of a decoded chunk.
std::size_t chunk_bytes(const ArrayMetadata& array);

/// The checksum that encoded bytes end with; 0 when they have none.
std::uint32_t last_checksum(std::span<const std::byte> encoded);

/// A chunk's place among those of an array, and its extent.
struct ChunkPlace {
  Int3 chunk, extent;
  Box3 box() const { return {chunk * extent, (chunk + Int3{1, 1, 1}) * extent}; }
};

/// Copies items from `box` (C order) to a decoded chunk: those of `part`, which is in both.
void pack_items(std::size_t bytes_of_item, Box3 box, std::span<const std::byte> items,
                const ChunkPlace& place, Box3 part, std::span<std::byte> decoded);

/// Reads the ranges of `part` from a decoded chunk into the table.
void unpack_ranges(ScalarType type, std::span<const std::byte> decoded, const ChunkPlace& place,
                   Box3 part, RangeTable& table);

/// The file of checksums: one of each chunk, then the checksum of those.
std::vector<std::uint32_t> with_own_checksum(std::vector<std::uint32_t> checksums);
/// The same backwards; nullopt for bytes that are no such file of `chunks` checksums.
struct ChunkChecksums {
  std::vector<std::uint32_t> chunks;
  std::uint32_t own = 0;
};
std::optional<ChunkChecksums> parse_range_checksums(std::span<const std::byte> bytes,
                                                    std::size_t chunks);

/// Calls f(place of a chunk, the part of the box in that chunk) for chunks of `extent` items.
template <class F>
void for_each_range_chunk(Box3 box, Int3 extent, F&& f) {
  for_each_point({floor_div(box.lo, extent), ceil_div(box.hi, extent)}, [&](Int3 c) {
    const ChunkPlace place{c, extent};
    f(place, intersect(box, place.box()));
  });
}

}  // namespace isobrick
