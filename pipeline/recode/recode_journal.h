#pragma once

#include <filesystem>
#include <string>

#include "io/bytes/output_folder.h"

namespace isobrick::inline v0 {

/// Remembers, beside the unfinished store, which store its bricks are of: an interrupted run on
/// another one must not be gone on with.
class RecodeJournal {
 public:
  /// `input` is what the store that is read is recognised by. Throws Error where a run that is
  /// resumed was begun with another one.
  RecodeJournal(const std::filesystem::path& staging, const std::string& input, bool resumed);

  /// The store is whole and has its name: the record goes.
  void remove();

 private:
  OutputFolder folder_;
  std::filesystem::path path_;
};

}  // namespace isobrick
