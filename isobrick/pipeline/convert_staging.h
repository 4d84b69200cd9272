#pragma once

#include <filesystem>

#include "isobrick/io/file.h"

namespace isobrick {

/// Where a store grows until it takes its place: `out` + ".partial". It stays
/// when a conversion fails, for a resume.
class ConvertStaging {
 public:
  /// Throws UsageError when `out` exists (and with `force` when it is no store,
  /// which is never removed) or a symbolic link, when something else than an
  /// interrupted conversion is in the way, or when an interrupted conversion is there that
  /// neither `resume` nor `force` says what to do with; Error when another
  /// process is writing it.
  ConvertStaging(std::filesystem::path out, bool resume, bool force);

  const std::filesystem::path& path() const { return staging_; }
  /// Whether there is something to go on with.
  bool resumed() const { return resumed_; }

  /// Moves the whole store to its place, in one step where the file system
  /// can; only then removes the one that was there.
  void publish();

 private:
  void check_out(bool force) const;
  void prepare(bool resume, bool force);
  void lock();

  std::filesystem::path out_, staging_;
  bool force_;
  bool resumed_ = false;
  UniqueFd lock_;
};

}  // namespace isobrick
