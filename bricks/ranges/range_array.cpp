#include "bricks/ranges/range_array.h"

#include <fmt/format.h>

#include <utility>

#include <isobrick/error.h>
#include "bricks/ranges/range_format.h"
#include "bricks/zarr/store_names.h"

namespace isobrick::inline v0 {
namespace {

// Four gigabytes of ranges: a store that claims to have more must be read in parts.
constexpr Index kMaxItemsAtOnce = Index{1} << 28;

constexpr std::uint64_t kKept = std::uint64_t{1} << 20;

}  // namespace

std::string brick_range_folder(const std::string& additions, int level) {
  return level_addition(additions, level, "range");
}

std::string block_range_folder(const std::string& additions, int level) {
  return level_addition(additions, level, "block_range");
}

RangeArrayReader::RangeArrayReader(std::shared_ptr<const Storage> storage, std::string folder,
                                   Int3 items, ScalarType type, std::uint32_t crc32c)
    : type_(type),
      chunk_grid_(ceil_div(items, range_chunk_extent(items))),
      array_(std::move(storage), std::move(folder), items, range_array_metadata(items, type),
             crc32c),
      chunks_(kKept) {}

std::shared_ptr<const RangeArrayReader::Chunk> RangeArrayReader::chunk(
    Int3 c, std::atomic<std::uint64_t>& bytes_read) const {
  const auto read = [&] { return std::make_shared<const Chunk>(array_.read_chunk(c, bytes_read)); };
  if (array_.chunk_extent() == kRangeChunkCube) return read();
  return chunks_.get(static_cast<std::uint64_t>(linear_index(c, chunk_grid_)), [&] {
    auto made = read();
    const std::uint64_t bytes = made->size();
    return std::pair(std::move(made), bytes);
  });
}

RangeTable RangeArrayReader::read(Box3 box, std::atomic<std::uint64_t>& bytes_read) const {
  array_.check_box(box);
  if (volume(box.extent()) > kMaxItemsAtOnce)
    throw Error(
        fmt::format("'{}': {} ranges are too many at once", array_.name(), volume(box.extent())));
  RangeTable table{box, {}};
  table.ranges.resize(static_cast<std::size_t>(volume(box.extent())));
  std::atomic<std::uint64_t> bytes = 0;
  for_each_range_chunk(box, array_.chunk_extent(), [&](const ChunkPlace& place, Box3 part) {
    unpack_ranges(type_, *chunk(place.chunk, bytes), place, part, table);
  });
  table.bytes_read = bytes;
  bytes_read += bytes;
  return table;
}

}  // namespace isobrick
