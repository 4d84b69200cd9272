#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <isobrick/store_reader.h>
#include "bricks/ranges/index_chunk.h"
#include "bricks/ranges/index_layout.h"

namespace isobrick {

/// Where an index of a level lies in a store.
std::filesystem::path index_folder(const std::filesystem::path& store, int level,
                                   const std::string& kind);
/// Its description and its chunks; below that folder.
std::filesystem::path index_description(const std::filesystem::path& folder);
std::filesystem::path index_chunk_path(const std::filesystem::path& folder, Int3 chunk);

/// The kinds of index that a level has, sorted; what is still being built is none.
std::vector<std::string> stored_index_kinds(const std::filesystem::path& store, int level);
/// The kinds of which the level has a folder, whole or not, sorted. Throws Error where that cannot
/// be looked at.
std::vector<std::string> index_folder_kinds(const std::filesystem::path& store, int level);
bool has_index(const std::filesystem::path& store, int level, const std::string& kind);

/// One index of one level. Thread-safe after construction.
class StoredIndex {
 public:
  /// Throws Error when the level has no such index, DamageError when its
  /// description is broken or that of another level.
  StoredIndex(const StoreReader& store, int level, const std::string& kind);

  const IndexLayout& layout() const { return layout_; }
  const std::filesystem::path& folder() const { return folder_; }
  IndexChunkName name_of(Int3 chunk) const { return {chunk, crc32c_}; }
  /// Throws DamageError as IndexChunk does.
  IndexChunk open(Int3 chunk) const;

 private:
  std::filesystem::path folder_;
  IndexLayout layout_;
  std::uint32_t crc32c_ = 0;  ///< of its description
};

/// The bytes of all files of an index.
std::uint64_t index_bytes(const StoredIndex& index);

}  // namespace isobrick
