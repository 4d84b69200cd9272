#include "bricks/ranges/range_format.h"

#include <cstring>

#include "bricks/zarr/codec.h"
#include "core/surface_range.h"

namespace isobrick::inline v0 {
namespace {

constexpr int kRangeZstdLevel = 3;

/// Calls f(byte offset in the chunk, item in the box, items) for each row of `part`.
template <class F>
void for_each_row(Box3 box, const ChunkPlace& place, Box3 part, std::size_t bytes_of_item,
                  const F& f) {
  for (Index z = part.lo.z; z < part.hi.z; ++z)
    for (Index y = part.lo.y; y < part.hi.y; ++y) {
      const Int3 p{part.lo.x, y, z};
      f(static_cast<std::size_t>(linear_index(p - place.box().lo, place.extent)) * bytes_of_item,
        static_cast<std::size_t>(linear_index(p - box.lo, box.extent())),
        static_cast<std::size_t>(part.extent().x));
    }
}

}  // namespace

Int3 range_chunk_extent(Int3 items) {
  Int3 chunk = kRangeChunkCube;
  for (;;) {
    int thin = 0, large = 0;
    while (thin < 3 && (chunk[thin] == 1 || 2 * items[thin] > chunk[thin])) ++thin;
    for (int axis = 1; axis < 3; ++axis)
      if (items[axis] * chunk[large] > items[large] * chunk[axis]) large = axis;
    if (thin == 3 || items[large] <= chunk[large]) return chunk;
    chunk[thin] /= 2;
    chunk[large] *= 2;
  }
}

ArrayMetadata range_array_metadata(Int3 items, ScalarType type) {
  ArrayMetadata metadata = checksum_array_metadata(items);
  metadata.shape.push_back(2);
  metadata.chunk.push_back(2);
  metadata.type = surface_type(type);
  metadata.dimension_names.emplace_back("bound");
  return metadata;
}

ArrayMetadata checksum_array_metadata(Int3 items) {
  ArrayMetadata metadata;
  metadata.shape = {items.z, items.y, items.x};
  const Int3 chunk = range_chunk_extent(items);
  metadata.chunk = {chunk.z, chunk.y, chunk.x};
  metadata.type = ScalarType::u32;
  metadata.codecs = CodecChain::ours(kRangeZstdLevel);
  metadata.dimension_names = {"z", "y", "x"};
  return metadata;
}

std::span<const std::byte> stored_pairs(ScalarType type, std::span<const std::byte> pairs,
                                        std::vector<std::byte>& room) {
  if (!is_wide_integer(type)) return pairs;
  room.resize(pairs.size());
  visit_sample(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    for (std::size_t at = 0; at < pairs.size(); at += sizeof(ValueRange<T>)) {
      ValueRange<T> range;
      std::memcpy(&range, pairs.data() + at, sizeof range);
      const ValueRange<double> rounded = surface_range(range);
      if constexpr (sizeof range == sizeof rounded)
        std::memcpy(room.data() + at, &rounded, sizeof rounded);
    }
  });
  return room;
}

std::size_t item_bytes(const ArrayMetadata& array) {
  const Index values = array.chunk.size() > 3 ? array.chunk[3] : 1;
  return static_cast<std::size_t>(values) * size_of(array.type);
}

std::size_t chunk_bytes(const ArrayMetadata& array) {
  return static_cast<std::size_t>(volume(kRangeChunkCube)) * item_bytes(array);
}

std::uint32_t last_checksum(std::span<const std::byte> encoded) {
  // The checksum of all bytes, their own checksum among them, would always be the same.
  std::uint32_t crc = 0;
  if (encoded.size() >= sizeof crc) std::memcpy(&crc, encoded.last(sizeof crc).data(), sizeof crc);
  return crc;
}

void pack_items(std::size_t bytes_of_item, Box3 box, std::span<const std::byte> items,
                const ChunkPlace& place, Box3 part, std::span<std::byte> decoded) {
  for_each_row(box, place, part, bytes_of_item,
               [&](std::size_t to, std::size_t item, std::size_t count) {
                 std::memcpy(decoded.data() + to, items.data() + item * bytes_of_item,
                             count * bytes_of_item);
               });
}

void unpack_ranges(ScalarType type, std::span<const std::byte> decoded, const ChunkPlace& place,
                   Box3 part, RangeTable& table) {
  visit_scalar(surface_type(type), [&](auto tag) {
    using T = typename decltype(tag)::type;
    for_each_row(table.box, place, part, 2 * sizeof(T),
                 [&](std::size_t from, std::size_t item, std::size_t count) {
                   const std::byte* bytes = decoded.data() + from;
                   ValueRange<double>* to = table.ranges.data() + item;
                   for (std::size_t x = 0; x < count; ++x, ++to, bytes += 2 * sizeof(T)) {
                     T pair[2];
                     std::memcpy(pair, bytes, sizeof pair);
                     *to = {static_cast<double>(pair[0]), static_cast<double>(pair[1])};
                   }
                 });
  });
}

std::vector<std::uint32_t> with_own_checksum(std::vector<std::uint32_t> checksums) {
  checksums.push_back(crc32c(std::as_bytes(std::span(checksums))));
  return checksums;
}

std::optional<ChunkChecksums> parse_range_checksums(std::span<const std::byte> bytes,
                                                    std::size_t chunks) {
  if (bytes.size() != (chunks + 1) * sizeof(std::uint32_t)) return std::nullopt;
  ChunkChecksums read;
  read.chunks.resize(chunks);
  const auto own = bytes.last(sizeof read.own), rest = bytes.first(bytes.size() - own.size());
  std::memcpy(read.chunks.data(), rest.data(), rest.size());
  std::memcpy(&read.own, own.data(), own.size());
  if (crc32c(rest) != read.own) return std::nullopt;
  return read;
}

}  // namespace isobrick
