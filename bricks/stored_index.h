#pragma once

#include <memory>
#include <string>
#include <vector>

#include <isobrick/storage.h>
#include <isobrick/store_reader.h>
#include "bricks/ranges/index_chunk.h"
#include "bricks/ranges/index_layout.h"

namespace isobrick::inline v0 {

/// Where an index of a level lies in a store, below `additions`: both are keys.
std::string index_folder(const std::string& additions, int level, const std::string& kind);
/// Its description and its chunks, below that folder.
inline constexpr const char* kIndexDescription = "index.json";
std::string index_chunk_name(Int3 chunk);

/// The kinds of index that a level has, sorted; what is still being built is none.
std::vector<std::string> stored_index_kinds(const StoreReader& store, int level);
/// The kinds of which the level has a folder, whole or not, sorted. Throws Error where that cannot
/// be looked at.
std::vector<std::string> index_folder_kinds(const StoreReader& store, int level);
bool has_index(const StoreReader& store, int level, const std::string& kind);
/// Hints that has_index() is called soon.
void hint_index(const StoreReader& store, int level, const std::string& kind);

/// One index of one level. Thread-safe after construction; does not need the reader any more.
class StoredIndex {
 public:
  /// Throws Error when the level has no such index, DamageError when its
  /// description is broken or that of another level.
  StoredIndex(const StoreReader& store, int level, const std::string& kind);

  const IndexLayout& layout() const { return layout_; }
  IndexChunkName name_of(Int3 chunk) const { return {chunk, crc32c_}; }
  /// Throws DamageError as IndexChunk does, and where there is no such chunk.
  IndexChunk open(Int3 chunk) const;
  /// Bytes of all its files; one that is missing has none.
  std::uint64_t bytes() const;

 private:
  std::shared_ptr<const StoredObject> open_chunk(Int3 chunk) const;

  std::shared_ptr<const Storage> storage_;
  std::string folder_;
  IndexLayout layout_;
  std::uint32_t crc32c_ = 0;  ///< of its description
};

}  // namespace isobrick
