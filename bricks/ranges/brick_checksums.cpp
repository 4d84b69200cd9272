#include "bricks/ranges/brick_checksums.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "bricks/zarr/store_names.h"

namespace isobrick::inline v0 {
namespace {

/// Of chunks that are kept, for bricks come in Morton order or in rows.
constexpr std::uint64_t kKept = std::uint64_t{1} << 20;

}  // namespace

std::string brick_checksum_folder(const std::string& additions, int level) {
  return level_addition(additions, level, "brick_crc32c");
}

std::uint32_t brick_checksum(const CodecChain& chain, std::span<const std::byte> encoded) {
  const bool ends_with_one = !chain.steps.empty() && chain.steps.back() == ByteCodec::crc32c;
  return ends_with_one ? last_checksum(encoded) : crc32c(encoded);
}

std::size_t brick_checksum_bytes(const LevelInfo& level) {
  const Int3 extent = range_chunk_extent(level.lattice.bricks());
  const Int3 chunks = ceil_div(level.lattice.bricks(), extent);
  const Index shard = ceil_div(level.shard, level.lattice.brick).z;
  const Index layers = std::min(chunks.z, shard / extent.z + 2);
  return static_cast<std::size_t>(chunks.x * chunks.y * layers) *
         chunk_bytes(checksum_array_metadata(level.lattice.bricks()));
}

BrickChecksums::BrickChecksums(std::shared_ptr<const Storage> storage, std::string folder,
                               Int3 bricks, std::uint32_t crc32c)
    : bricks_(bricks),
      array_(std::move(storage), std::move(folder), bricks, checksum_array_metadata(bricks),
             crc32c),
      chunks_(kKept) {}

std::uint32_t BrickChecksums::at(Int3 brick, std::atomic<std::uint64_t>& bytes_read) const {
  const ChunkPlace place{floor_div(brick, array_.chunk_extent()), array_.chunk_extent()};
  const Int3 grid = ceil_div(bricks_, place.extent);
  const auto chunk = chunks_.get(static_cast<std::uint64_t>(linear_index(place.chunk, grid)), [&] {
    auto read =
        std::make_shared<const std::vector<std::byte>>(array_.read_chunk(place.chunk, bytes_read));
    const std::uint64_t bytes = read->size();
    return std::pair(std::move(read), bytes);
  });
  const auto item = static_cast<std::size_t>(linear_index(brick - place.box().lo, place.extent));
  std::uint32_t crc = 0;
  std::memcpy(&crc, chunk->data() + item * sizeof crc, sizeof crc);
  return crc;
}

}  // namespace isobrick
