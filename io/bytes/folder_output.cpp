#include "io/bytes/folder_output.h"

#include <fmt/format.h>

#include <utility>
#include <vector>

#include <isobrick/error.h>
#include "io/bytes/folder_walk.h"
#include "io/bytes/output_folder.h"
#include "io/bytes/output_guard.h"
#include "io/bytes/rename.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// The first entry of a folder that is no part of an output, from `root` on; empty: none. Folders
/// are parts that hold parts and nothing else.
fs::path find_foreign(const fs::path& root, const fs::path& folder,
                      const FolderOutput::IsOwnName& is_own_name) {
  const std::vector<FolderEntry> entries = folder_entries(root / folder);
  if (entries.empty() && !folder.empty()) return folder;
  for (const FolderEntry& entry : entries) {
    const fs::path name = folder / entry.name;
    if (entry.type == fs::file_type::directory) {
      if (fs::path foreign = find_foreign(root, name, is_own_name); !foreign.empty())
        return foreign;
    } else if (entry.type != fs::file_type::regular || !is_own_name(name.native())) {
      return name;
    }
  }
  return {};
}

}  // namespace

FolderOutput::FolderOutput(fs::path path, bool force, IsOwnName is_own_name)
    : path_(without_slash(path)), force_(force), is_own_name_(std::move(is_own_name)) {
  remove_leftovers(path_.string(), true);
  check_place();
  temporary_ = create_temporary_folder(path_.string());
}

FolderOutput::~FolderOutput() {
  std::error_code ignored;
  if (!temporary_.path.empty()) fs::remove_all(temporary_.path, ignored);
}

void FolderOutput::check_place() const {
  if (!is_there(path_)) return;
  if (!force_)
    throw UsageError(fmt::format("'{}' exists already; add --force to replace it", path_.string()));
  if (fs::symlink_status(path_).type() != fs::file_type::directory)
    throw UsageError(fmt::format("'{}' is no folder; name another output", path_.string()));
  if (const fs::path foreign = find_foreign(path_, {}, is_own_name_); !foreign.empty())
    throw UsageError(fmt::format("'{}' holds '{}', which is no part of the output; move it away",
                                 path_.string(), foreign.string()));
  check_replaces_no_input(path_, {});
}

void FolderOutput::publish() {
  const Publication turn;
  check_place();
  if (is_there(path_)) {
    const fs::path parent = path_.has_parent_path() ? path_.parent_path() : fs::path(".");
    OutputFolder(parent).replace_folder(parent / fs::path(temporary_.path).filename(),
                                        parent / path_.filename());
  } else if (const int failure = rename_no_replace(temporary_.path, path_); failure != 0) {
    throw system_error("rename the finished folder to", path_.string(), failure);
  }
  temporary_.path.clear();
}

}  // namespace isobrick
