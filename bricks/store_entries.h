#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <isobrick/level_info.h>
#include "bricks/zarr/array_metadata.h"

namespace isobrick::inline v0 {

/// Which files and folders a store of ours has: its levels, and of each the chunks that lie within
/// its grids.
class StoreEntries {
 public:
  /// Those of the store in `folder`, or of the conversion that was interrupted there, as its
  /// metadata lists them. Without such a list any number of levels and chunks belongs to it, and
  /// why() is the reason.
  static StoreEntries of(const std::filesystem::path& folder);
  /// Those of a store with these levels, for what is below its isobrick/.
  static StoreEntries of(std::span<const LevelInfo> levels);

  /// Why the metadata does not list the store's entries, as the end of a sentence; empty if it
  /// does.
  const std::string& why() const { return why_; }

  /// Whether the store has a file or a folder of this name, relative to it. Temporary files belong
  /// to a conversion that has not ended, and below isobrick/ to any store.
  bool has(const std::filesystem::path& path, std::filesystem::file_type type) const;

 private:
  struct Level {
    std::filesystem::path first;  ///< "c" of its chunks' names, or empty
    Int3 shards, bricks, blocks, index_chunks;
  };
  using Names = std::span<const std::string>;

  void add_level(const ArrayMetadata& array);
  const Level* level(const std::string& name) const;
  bool has_at_root(const std::string& name, bool folder) const;
  bool has_in_level(const Level& level, Names names, bool folder) const;
  bool has_addition(Names names, bool folder) const;

  std::vector<Level> levels_;
  bool unfinished_ = false;
  bool any_ = false;  ///< of any number of levels and chunks
  std::string why_;
};

/// The first thing found in `folder` that no such store has there, as a path relative to it: a file
/// or folder of another name, a link, a device. Nothing if there is none. `place` is where in the
/// store the folder lies: "" for all of it, "isobrick/0/index/octree" for that index.
std::optional<std::filesystem::path> find_foreign_entry(const std::filesystem::path& folder,
                                                        const StoreEntries& store,
                                                        const std::filesystem::path& place = {});

/// Why `folder` is not a store of ours and nothing else, as the end of a sentence; empty if it is
/// one. Only such folders may be replaced.
std::string why_not_our_store(const std::filesystem::path& folder);

/// Throws UsageError when `folder`, which lies at `place` in a store, must stay: something in it
/// is not what the store has there, or it holds one of `inputs` or the current directory. There may
/// be no such folder.
void check_replaceable(const std::filesystem::path& folder, const StoreEntries& store,
                       const std::filesystem::path& place,
                       std::span<const std::filesystem::path> inputs = {});

}  // namespace isobrick
