#include "bricks/ranges/index_chunk.h"

#include <fmt/format.h>

#include <cstring>

#include <isobrick/error.h>
#include "bricks/storage/folder_storage.h"
#include "bricks/zarr/codec.h"

namespace isobrick::inline v0 {
namespace {

/// Larger files are not read at once: it is about what a disk reads in the time
/// of one seek, or of one request to a network.
constexpr std::uint64_t kSmallFile = std::uint64_t{512} << 10;

/// As the checksum takes it: x, y and z as u64, then the index's checksum.
std::vector<std::byte> bytes_of(const IndexChunkName& name) {
  std::vector<std::byte> bytes(3 * sizeof(std::uint64_t) + sizeof name.index_crc32c);
  for (int axis = 0; axis < 3; ++axis) {
    const auto at = static_cast<std::size_t>(axis) * sizeof(std::uint64_t);
    const auto value = static_cast<std::uint64_t>(name.chunk[axis]);
    std::memcpy(bytes.data() + at, &value, sizeof value);
  }
  std::memcpy(bytes.data() + 3 * sizeof(std::uint64_t), &name.index_crc32c,
              sizeof name.index_crc32c);
  return bytes;
}

CodecChain chain_of(bool compressed) {
  return CodecChain::ours(compressed ? std::optional(0) : std::nullopt);
}

}  // namespace

std::vector<std::byte> encode_index_part(std::optional<int> zstd_level,
                                         std::span<const std::byte> bytes) {
  return encode_bytes(CodecChain::ours(zstd_level), bytes);
}

IndexChunkWriter::IndexChunkWriter(Publisher& publisher, std::filesystem::path path,
                                   std::size_t parts, const IndexChunkName& name)
    : publisher_(publisher),
      path_(std::move(path)),
      name_(name),
      file_(publisher.create_temporary(path_)),
      places_(parts) {}

IndexChunkWriter::~IndexChunkWriter() {
  if (file_) publisher_.discard_temporary(path_);
}

void IndexChunkWriter::append(std::size_t part, std::span<const std::byte> encoded) {
  file_.write_at(end_, encoded);
  places_[part] = {end_, encoded.size()};
  end_ += encoded.size();
}

void IndexChunkWriter::publish() {
  const std::vector<std::byte> places = places_.encode(bytes_of(name_));
  file_.write_at(end_, places);
  publisher_.count(end_ + places.size());
  publisher_.publish(std::move(file_), path_);
}

void rename_index_chunk(File& file, std::size_t parts, const IndexChunkName& from,
                        const IndexChunkName& to) {
  const std::uint64_t tail = ShardIndex::encoded_size(parts, true), size = file.size();
  if (size < tail) throw DamageError(fmt::format("{} bytes are no chunk of an index", size));
  std::vector<std::byte> bytes(static_cast<std::size_t>(tail));
  file.read_at(size - tail, bytes);
  const ShardIndex places = ShardIndex::decode(bytes, true, size - tail, bytes_of(from));
  file.write_at(size - tail, places.encode(bytes_of(to)));
}

IndexChunk::IndexChunk(std::shared_ptr<const StoredObject> file, std::size_t parts, bool compressed,
                       const IndexChunkName& name)
    : file_(std::move(file)), compressed_(compressed), size_(file_->size()), places_(parts) {
  const std::uint64_t tail = ShardIndex::encoded_size(parts, true);
  if (size_ < tail)
    throw DamageError(fmt::format("'{}': {} bytes are too few for {} parts of an index",
                                  file_->name(), size_, parts));
  std::vector<std::byte> bytes(static_cast<std::size_t>(tail));
  file_->read(size_ - tail, bytes);
  bytes_read_ += tail;
  try {
    places_ = ShardIndex::decode(bytes, true, size_ - tail, bytes_of(name));
  } catch (const DamageError& e) {
    throw DamageError(
        fmt::format("'{}': {}; is it a chunk of another place or store?", file_->name(), e.what()));
  }
  // Parts leave no gaps, so their sizes sum up to the file's.
  if (places_.brick_bytes() != size_ - tail)
    throw DamageError(fmt::format("'{}' has {} bytes, but its parts and their places {}",
                                  file_->name(), size_, places_.brick_bytes() + tail));
}

void IndexChunk::read_whole() {
  if (size_ > kSmallFile) return;
  std::vector<std::byte> bytes(static_cast<std::size_t>(size_));
  file_->read(0, bytes);
  bytes_read_ += size_;
  whole_ = std::move(bytes);
}

bool IndexChunk::is_whole(const std::filesystem::path& path, std::size_t parts,
                          const IndexChunkName& name) {
  try {
    auto file = open_file_object(path);
    if (!file) return false;
    const IndexChunk chunk(std::move(file), parts, false, name);
    return true;
  } catch (const DamageError&) {
    return false;
  }
}

std::span<const std::byte> IndexChunk::encoded(const ShardIndex::Entry& place,
                                               std::vector<std::byte>& buffer) const {
  const auto size = static_cast<std::size_t>(place.size);
  if (!whole_.empty())
    return std::span(whole_).subspan(static_cast<std::size_t>(place.offset), size);
  if (place.size > kMaxIndexPartBytes + kMaxIndexPartBytes / 8)
    throw DamageError("too long for a part of an index");
  buffer.resize(size);
  file_->read(place.offset, buffer);
  bytes_read_ += place.size;
  return buffer;
}

bool IndexChunk::read(std::size_t part, std::vector<std::byte>& out) const {
  if (!has(part)) return false;
  const CodecChain chain = chain_of(compressed_);
  try {
    std::vector<std::byte> buffer;
    const auto bytes = encoded(places_[part], buffer);
    const std::uint64_t size = decoded_size(chain, bytes);
    if (size > kMaxIndexPartBytes)
      throw DamageError(fmt::format("{} bytes are too many for a part of an index", size));
    out.resize(static_cast<std::size_t>(size));
    decode_bytes(chain, 1, bytes, out);
  } catch (const DamageError& e) {
    throw DamageError(fmt::format("{}: {}", where(part), e.what()));
  }
  return true;
}

std::string IndexChunk::where(std::size_t part) const {
  return fmt::format("'{}' at {} + {}", file_->name(), places_[part].offset, places_[part].size);
}

}  // namespace isobrick
