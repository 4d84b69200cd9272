#pragma once

#include <filesystem>

#include "io/bytes/file.h"

namespace isobrick::inline v0 {

/// A folder that is written to, such as a store. Every path that a function takes is that of
/// something below the folder, written as root() / …. No function follows a symbolic link below
/// the root: nothing outside is created, changed or removed. The folder
/// stays the same one when it is renamed. Thread-safe.
class OutputFolder {
 public:
  /// Opens an existing folder. Links in `root` itself are followed: that is the user's own name
  /// for it.
  explicit OutputFolder(const std::filesystem::path& root);

  const std::filesystem::path& root() const { return root_; }

  /// Creates a file, open for reading and writing, and the folders above it as needed. What has
  /// the name already is removed, not emptied: it may be a link.
  File create_file(const std::filesystem::path& path) const;
  /// Opens an existing regular file with `access` (O_RDONLY or O_RDWR); no file when there is none.
  /// Throws Error for anything else, a link included.
  File open_file(const std::filesystem::path& path, int access) const;
  /// Opens a folder, which is made when missing.
  UniqueFd make_folder(const std::filesystem::path& path) const;

  /// Replaces a file at `to`.
  void rename_file(const std::filesystem::path& from, const std::filesystem::path& to) const;
  /// Removes a file or a link, if there is one.
  void remove_file(const std::filesystem::path& path) const;
  /// Removes a folder with all that is in it, if there is one; of a link only the link.
  void remove_folder(const std::filesystem::path& path) const;
  /// Moves a finished folder to its place, in one step where the file system can; only then
  /// removes the one that was there. Both have the same parent. Durable when it returns.
  void replace_folder(const std::filesystem::path& finished,
                      const std::filesystem::path& place) const;
  /// Makes the entries of a folder durable.
  void sync_folder(const std::filesystem::path& path) const;

 private:
  struct Place;
  Place find(const std::filesystem::path& path, bool make_folders) const;

  std::filesystem::path root_;
  UniqueFd fd_;
};

}  // namespace isobrick
