#pragma once

#include <filesystem>
#include <functional>
#include <string_view>

#include "io/bytes/leftovers.h"

namespace isobrick::inline v0 {

/// A folder of files that appears under its name only when all of them are whole. It is written
/// under a temporary name beside it, which the destructor removes unless publish() was called; what
/// a killed process left of the same output is removed first.
class FolderOutput {
 public:
  /// Whether a file of this name, which begins with those of folders within the output, belongs to
  /// such an output.
  using IsOwnName = std::function<bool(std::string_view)>;

  /// Throws UsageError when `path` exists and `force` is not set, or when it is no folder of files
  /// with own names only; Error when it cannot be made.
  FolderOutput(std::filesystem::path path, bool force, IsOwnName is_own_name);
  ~FolderOutput();
  FolderOutput(const FolderOutput&) = delete;
  FolderOutput& operator=(const FolderOutput&) = delete;

  /// Where the files go.
  std::filesystem::path folder() const { return temporary_.path; }
  const std::filesystem::path& path() const { return path_; }

  /// Moves the folder to its place. Replaces one that is there only with `force`. Throws Cancelled
  /// when an end was requested.
  void publish();

 private:
  /// Throws when a folder that is there must stay.
  void check_place() const;

  std::filesystem::path path_;
  bool force_;
  IsOwnName is_own_name_;
  Temporary temporary_;  ///< without a path once published
};

}  // namespace isobrick
