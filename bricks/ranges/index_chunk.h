#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <isobrick/storage.h>
#include <isobrick/vec.h>
#include "bricks/zarr/publisher.h"
#include "bricks/zarr/shard_index.h"
#include "io/bytes/file.h"

// The file of an index chunk: parts, each encoded like a brick, and where they
// are. What a part holds is not known here. docs/reference/store_format.md has the bytes.

namespace isobrick::inline v0 {

/// A decoded part has no more bytes than this; longer ones are refused, so that
/// broken files cannot take all the memory.
inline constexpr std::uint64_t kMaxIndexPartBytes = std::uint64_t{64} << 20;

/// Which chunk of which index a file is. This enters the checksum of its places, so that a whole
/// chunk of another place, index or store is refused.
struct IndexChunkName {
  Int3 chunk;
  std::uint32_t index_crc32c = 0;  ///< the checksum in index.json
};

/// Encodes a part. Thread-safe.
std::vector<std::byte> encode_index_part(std::optional<int> zstd_level,
                                         std::span<const std::byte> bytes);

/// Writes one index chunk under its temporary name, part after part.
class IndexChunkWriter {
 public:
  /// The chunk will be `path`, in the folder of `publisher`.
  IndexChunkWriter(Publisher& publisher, std::filesystem::path path, std::size_t parts,
                   const IndexChunkName& name);
  /// Removes what was not published.
  ~IndexChunkWriter();
  IndexChunkWriter(const IndexChunkWriter&) = delete;
  IndexChunkWriter& operator=(const IndexChunkWriter&) = delete;

  /// Each part once at most; those that never come are absent.
  void append(std::size_t part, std::span<const std::byte> encoded);
  /// Ends the file and hands it to the publisher.
  void publish();

 private:
  Publisher& publisher_;
  std::filesystem::path path_;
  IndexChunkName name_;
  File file_;
  ShardIndex places_;
  std::uint64_t end_ = 0;
};

/// Gives a whole chunk, open for reading and writing, another name: only its places are written
/// anew. Throws DamageError where it has not the name `from`.
void rename_index_chunk(File& file, std::size_t parts, const IndexChunkName& from,
                        const IndexChunkName& to);

/// Reads one index chunk. Thread-safe after construction.
class IndexChunk {
 public:
  /// Reads where the parts are. DamageError when the file is not whole, or another chunk.
  IndexChunk(std::shared_ptr<const StoredObject> file, std::size_t parts, bool compressed,
             const IndexChunkName& name);

  /// Whether the file, if it is there, has a checksum and a size that are right.
  static bool is_whole(const std::filesystem::path& path, std::size_t parts,
                       const IndexChunkName& name);

  /// How messages name it, without quotes.
  std::string name() const { return file_->name(); }
  /// Bytes of the file.
  std::uint64_t bytes() const { return size_; }
  /// Bytes read from it so far.
  std::uint64_t bytes_read() const { return bytes_read_; }
  bool has(std::size_t part) const { return !places_[part].absent(); }

  /// Reads all of a file that is not large at once, for those who then want many
  /// of its parts. Not thread-safe.
  void read_whole();

  /// Checks and decodes a part into `out`; false when it is absent. Throws
  /// DamageError naming file and offset.
  bool read(std::size_t part, std::vector<std::byte>& out) const;
  /// "'file' at 12 + 345": how messages name a part.
  std::string where(std::size_t part) const;

 private:
  std::span<const std::byte> encoded(const ShardIndex::Entry& place,
                                     std::vector<std::byte>& buffer) const;

  std::shared_ptr<const StoredObject> file_;
  bool compressed_;
  std::uint64_t size_ = 0;
  ShardIndex places_;
  std::vector<std::byte> whole_;  ///< all of the file, if it was read whole
  mutable std::atomic<std::uint64_t> bytes_read_ = 0;
};

}  // namespace isobrick
