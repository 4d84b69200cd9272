#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include <isobrick/progress.h>
#include "io/bytes/file.h"
#include "io/bytes/output_folder.h"

namespace isobrick::inline v0 {

/// Where the store `out` grows until it takes its place: `out` + ".partial".
std::filesystem::path staging_path(const std::filesystem::path& out);

/// Whether a store of this name is written as a zip: .zip, or .ozx as OME-Zarr names it.
bool is_zip_name(const std::filesystem::path& out);

/// The folder at staging_path(). It stays when a conversion fails, for a resume. A store that is
/// to be a zip grows in it like any other.
///
/// A store keeps the marker of an unfinished conversion until it has its place and the one that
/// was there is gone. So a marker at `out` means that a process was killed while it
/// published: then ".partial" is what is left of the old store.
class ConvertStaging {
 public:
  /// First ends what a killed process began to publish; with `resume` its store goes back to
  /// ".partial", so that the input is compared like that of any other interrupted conversion.
  /// Throws UsageError when `out` is a symbolic link, or exists and `force` may not replace it:
  /// `force` replaces a store of ours that has nothing else in it, none of `inputs` and not the
  /// current directory, and in place of a zip any file that is none of `inputs`. Throws UsageError
  /// too when anything but an interrupted conversion is at
  /// ".partial", or when one is there and neither `resume` nor `force` is set. Throws
  /// Error when another process is writing it.
  ConvertStaging(std::filesystem::path out, bool resume, bool force,
                 std::vector<std::filesystem::path> inputs);

  const std::filesystem::path& path() const { return staging_; }
  /// Whether there is something to go on with.
  bool resumed() const { return resumed_; }

  /// Moves the whole store to its place, in one step where the file system
  /// can; only then removes the one that was there. A zip is written there, and of the folder the
  /// marker is left. That is the caller's to remove.
  void publish(Progress& progress);
  /// Nothing follows: removes the folder that a zip was made of.
  void finish() const;

 private:
  void end_publication(bool resume);
  void check_zip() const;
  void write_zip(Progress& progress) const;
  void check_out(bool resume) const;
  void prepare(bool resume);
  void clear(bool marker) const;
  void remove_replaced(const std::filesystem::path& folder) const;

  std::filesystem::path out_, staging_, aside_;
  bool zip_, force_;
  std::vector<std::filesystem::path> inputs_;
  OutputFolder parent_;
  bool resumed_ = false;
  UniqueFd lock_;
};

}  // namespace isobrick
