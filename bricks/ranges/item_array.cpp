#include "bricks/ranges/item_array.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include <isobrick/error.h>
#include "bricks/storage/storage_keys.h"
#include "bricks/zarr/codec.h"
#include "bricks/zarr/json_reader.h"

namespace isobrick::inline v0 {
namespace {

constexpr const char* kChecksums = "checksums";

/// Below the array's folder.
std::string chunk_name(const ArrayMetadata& array, Int3 c) {
  std::vector<Index> place{c.z, c.y, c.x};
  place.resize(array.shape.size());
  return array.chunk_key(place);
}

void check_box_within(Box3 box, Int3 items) {
  if (box.empty() || intersect(box, {{0, 0, 0}, items}) != box)
    throw UsageError("items were requested or given outside of the volume");
}

}  // namespace

ItemArrayWriter::ItemArrayWriter(std::filesystem::path folder, Int3 items, ArrayMetadata array,
                                 Publisher& publisher)
    : folder_(std::move(folder)),
      items_(items),
      chunk_extent_(range_chunk_extent(items)),
      chunk_grid_(ceil_div(items, chunk_extent_)),
      array_(std::move(array)),
      publisher_(publisher),
      complete_(static_cast<std::size_t>(volume(chunk_grid_))),
      checksums_(complete_.size()) {}

void ItemArrayWriter::put(Box3 box, std::span<const std::byte> items) {
  check_box_within(box, items_);
  if (items.size() != static_cast<std::size_t>(volume(box.extent())) * item_bytes(array_))
    throw UsageError("items of the wrong size were given");
  for_each_range_chunk(box, chunk_extent_, [&](const ChunkPlace& place, Box3 part) {
    const Int3 c = place.chunk;
    const Box3 whole = intersect(place.box(), {{0, 0, 0}, items_});
    const auto key = std::tuple(c.z, c.y, c.x);
    Chunk complete;
    {
      const std::lock_guard lock(mutex_);
      Chunk& chunk = chunks_[key];
      if (chunk.bytes.empty()) {
        chunk.bytes.resize(chunk_bytes(array_));
        chunk.missing = volume(whole.extent());
      }
      pack_items(item_bytes(array_), box, items, place, part, chunk.bytes);
      chunk.missing -= volume(part.extent());
      if (chunk.missing > 0) return;
      complete = std::move(chunk);
      chunks_.erase(key);
      complete_[number(c)] = true;
      ++complete_count_;
    }
    write_chunk(c, complete.bytes);
  });
}

void ItemArrayWriter::put_encoded_chunk(Int3 c, std::span<const std::byte> encoded) {
  {
    const std::lock_guard lock(mutex_);
    complete_[number(c)] = true;
    ++complete_count_;
  }
  write_encoded(c, encoded);
}

void ItemArrayWriter::fill_below(Index z) {
  const Index layers = z >= items_.z ? chunk_grid_.z : z / chunk_extent_.z;
  std::vector<std::byte> zeros;  // encoded
  for (; filled_below_ < layers; ++filled_below_)
    for_each_point(
        {{0, 0, filled_below_}, {chunk_grid_.x, chunk_grid_.y, filled_below_ + 1}}, [&](Int3 c) {
          Chunk begun;
          {
            const std::lock_guard lock(mutex_);
            if (complete_[number(c)]) return;
            complete_[number(c)] = true;
            ++complete_count_;
            if (auto found = chunks_.extract(std::tuple(c.z, c.y, c.x)))
              begun = std::move(found.mapped());
          }
          if (!begun.bytes.empty()) return write_chunk(c, begun.bytes);
          if (zeros.empty())
            zeros = encode_bytes(array_.codecs, std::vector<std::byte>(chunk_bytes(array_)));
          write_encoded(c, zeros);
        });
}

void ItemArrayWriter::write_chunk(Int3 c, std::span<const std::byte> decoded) {
  write_encoded(c, encode_bytes(array_.codecs, decoded));
}

void ItemArrayWriter::write_encoded(Int3 c, std::span<const std::byte> encoded) {
  // Each chunk is written once, so that nobody else has this place.
  checksums_[number(c)] = last_checksum(encoded);
  publisher_.write(folder_ / chunk_name(array_, c), encoded);
}

std::optional<std::uint32_t> ItemArrayWriter::finish() {
  const std::lock_guard lock(mutex_);
  if (complete_count_ == 0 && chunks_.empty()) return std::nullopt;
  if (!chunks_.empty() || complete_count_ != volume(chunk_grid_))
    throw Error(fmt::format("'{}': only some of the items were given", folder_.string()));
  const std::vector<std::uint32_t> all = with_own_checksum(checksums_);
  publisher_.write(folder_ / kChecksums, std::as_bytes(std::span(all)));
  publisher_.write(folder_ / "zarr.json", to_json(array_));
  return all.back();
}

void ItemArrayReader::will_open(const Storage& storage, const std::string& folder) {
  for (const char* name : {"zarr.json", kChecksums}) storage.will_open(join_key(folder, name));
}

ItemArrayReader::ItemArrayReader(std::shared_ptr<const Storage> storage, std::string folder,
                                 Int3 items, ArrayMetadata array, std::uint32_t crc32c)
    : storage_(std::move(storage)),
      folder_(std::move(folder)),
      items_(items),
      array_(std::move(array)) {
  const std::string key = join_key(folder_, "zarr.json"), where = quoted(*storage_, key);
  const auto text = read_small_object(*storage_, key, kMaxMetadataBytes);
  if (!text) {
    exists_ = false;
    wrong_ = where + " is missing";
    return;
  }
  const ArrayMetadata found = parse_array_metadata(*text, where);
  if (found.shape != array_.shape || found.chunk != array_.chunk || found.type != array_.type ||
      found.sharding)
    throw DamageError(where + ": shape, chunks or type are not those that belong to this level");
  array_ = found;
  read_checksums(crc32c);
}

/// Reading chunks reports what is wrong here: a caller can compute the items anew.
void ItemArrayReader::read_checksums(std::uint32_t expected) {
  const std::string key = join_key(folder_, kChecksums);
  const auto count = static_cast<std::size_t>(volume(ceil_div(items_, chunk_extent())));
  const std::size_t bytes = (count + 1) * sizeof(std::uint32_t);
  const auto text = read_small_object(*storage_, key, bytes);
  auto read = text ? parse_range_checksums(std::as_bytes(std::span(*text)), count) : std::nullopt;
  if (!read) {
    wrong_ = fmt::format("{} is {}", quoted(*storage_, key), text ? "damaged" : "missing");
    return;
  }
  if (read->own != expected) wrong_ = quoted(*storage_, key) + " is that of another level or store";
  checksums_ = std::move(read->chunks);
}

void ItemArrayReader::check_box(Box3 box) const { check_box_within(box, items_); }

ItemArrayReader::ReadChunk ItemArrayReader::read(Int3 c) const {
  if (!wrong_.empty()) throw DamageError(wrong_);
  const std::size_t size = chunk_bytes(array_);
  const std::string key = join_key(folder_, chunk_name(array_, c));
  auto content = read_small_object(*storage_, key, 2 * size + 1024);
  // Chunks are written even where all items are alike, so none may be missing.
  if (!content) throw DamageError(quoted(*storage_, key) + " is missing");
  const auto encoded = std::as_bytes(std::span(*content));
  std::vector<std::byte> decoded(size);
  try {
    decode_bytes(array_.codecs, size_of(array_.type), encoded, decoded);
  } catch (const DamageError& e) {
    throw DamageError(fmt::format("{}: {}", quoted(*storage_, key), e.what()));
  }
  const Int3 grid = ceil_div(items_, chunk_extent());
  if (last_checksum(encoded) != checksums_[static_cast<std::size_t>(linear_index(c, grid))])
    throw DamageError(quoted(*storage_, key) + " is the chunk of another place, level or store");
  return {std::move(*content), std::move(decoded)};
}

std::vector<std::byte> ItemArrayReader::read_chunk(Int3 c,
                                                   std::atomic<std::uint64_t>& bytes_read) const {
  ReadChunk chunk = read(c);
  bytes_read += chunk.encoded.size();
  return std::move(chunk.decoded);
}

void ItemArrayReader::copy_to(ItemArrayWriter& writer) const {
  for_each_point({{0, 0, 0}, ceil_div(items_, chunk_extent())}, [&](Int3 c) {
    const ReadChunk chunk = read(c);
    writer.put_encoded_chunk(c, std::as_bytes(std::span(chunk.encoded)));
  });
}

}  // namespace isobrick
