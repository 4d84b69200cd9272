#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include <isobrick/progress.h>
#include "io/bytes/file.h"

namespace isobrick::inline v0 {

/// One store in a folder of stores: CACHE/NAME with `store.zarr`, what it was made of, and a lock.
/// While an entry is held, no process removes it.
class CacheEntry {
 public:
  /// The entry for a volume that `key`, any text, describes; `name` makes the folder readable.
  /// Makes the folders. Waits while another process fills the entry, and lets `progress` cancel
  /// that. Throws Error where the folders cannot be made.
  CacheEntry(const std::filesystem::path& cache, const std::string& name, std::string key,
             Progress& progress);

  std::filesystem::path store() const { return folder_ / "store.zarr"; }
  /// Whether the store is there with all its files, and made of the same.
  bool is_filled() const;
  /// Removes what is left of a store that is damaged or of other content.
  void clear();
  /// The store is whole: notes its key and its files.
  void set_filled();
  /// From now on others may hold it, too. Counts as a use.
  void share();
  /// Whether the entry may be filled; false in a cache that only others may write.
  bool can_be_filled() const { return writable_; }

 private:
  std::filesystem::path folder_;
  std::string key_;
  UniqueFd lock_;
  bool writable_ = true;
};

/// Removes entries that nobody holds, the one that was used longest ago first, until the rest has
/// at most `limit` bytes. What cannot be removed stays.
void shrink_cache(const std::filesystem::path& cache, std::uint64_t limit);

}  // namespace isobrick
