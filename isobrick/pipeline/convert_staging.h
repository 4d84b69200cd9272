#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include "isobrick/io/file.h"
#include "isobrick/io/output_folder.h"

namespace isobrick {

/// Where a store grows until it takes its place: `out` + ".partial". It stays
/// when a conversion fails, for a resume.
///
/// A store keeps the marker of an unfinished conversion until it has its place and the one that
/// was there is gone. So a marker at `out` says that a process was killed while it published:
/// what lies at ".partial" then is the old store, whatever is left of it.
class ConvertStaging {
 public:
  /// First ends what a killed process began to publish; with `resume` its store goes back to
  /// ".partial", so that the input is compared like that of any other interrupted conversion.
  /// Throws UsageError when `out` exists (and with `force` when it is not a store of ours and
  /// nothing else, or holds one of `inputs` or the current directory) or is a symbolic link, when
  /// something else than an interrupted conversion is in the way, or when an interrupted
  /// conversion is there that neither `resume` nor `force` says what to do with; Error when
  /// another process is writing it.
  ConvertStaging(std::filesystem::path out, bool resume, bool force,
                 std::vector<std::filesystem::path> inputs);

  const std::filesystem::path& path() const { return staging_; }
  /// Whether there is something to go on with.
  bool resumed() const { return resumed_; }

  /// Moves the whole store to its place, in one step where the file system
  /// can; only then removes the one that was there. The marker is the caller's to remove.
  void publish();

 private:
  void end_publication(bool resume);
  void check_out(bool resume) const;
  void prepare(bool resume);
  void clear() const;
  void remove_replaced(const std::filesystem::path& folder) const;

  std::filesystem::path out_, staging_, aside_;
  bool force_;
  std::vector<std::filesystem::path> inputs_;
  OutputFolder parent_;
  bool resumed_ = false;
  UniqueFd lock_;
};

}  // namespace isobrick
