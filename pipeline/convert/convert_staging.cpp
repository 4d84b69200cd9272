#include "pipeline/convert/convert_staging.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>

#include <isobrick/error.h>
#include "bricks/storage/write_zip.h"
#include "bricks/store_entries.h"
#include "bricks/zarr/store_names.h"
#include "io/bytes/exchange.h"
#include "io/bytes/folder_walk.h"
#include "io/bytes/output_file.h"
#include "io/bytes/output_guard.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

bool is_folder(const fs::path& path) { return fs::is_directory(fs::symlink_status(path)); }

bool has_marker(const fs::path& folder) {
  return is_folder(folder) && is_there(folder / kLayoutMarker);
}

/// Whether a conversion stopped before its first file, the marker, was whole.
bool nothing_to_resume(const fs::path& staging) {
  const std::string marker = temporary_name(kLayoutMarker).string();
  return std::ranges::all_of(folder_entries(staging), [&](const FolderEntry& entry) {
    return entry.name == marker && entry.type == fs::file_type::regular;
  });
}

fs::path without_last_slash(fs::path path) {
  return path.has_filename() ? path : path.parent_path();
}

fs::path checked_name(fs::path out) {
  out = without_last_slash(std::move(out));
  if (out.empty() || out.filename() == "." || out.filename() == "..")
    throw UsageError(fmt::format("'{}' is no name for a store", out.string()));
  return out;
}

fs::path parent_of(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

/// Keeps other conversions away from a folder.
UniqueFd lock_folder(const OutputFolder& parent, const fs::path& folder) {
  UniqueFd lock = parent.make_folder(folder);
  struct stat locked {
  }, named{};
  const bool taken = ::flock(lock.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  // Another process may have moved it to its place before it let go of it.
  const bool moved =
      !taken && (::fstat(lock.get(), &locked) != 0 || ::lstat(folder.c_str(), &named) != 0 ||
                 locked.st_ino != named.st_ino);
  if (taken || moved)
    throw Error(fmt::format("another conversion is writing '{}'", folder.string()));
  return lock;
}

}  // namespace

bool is_zip_name(const fs::path& out) {
  const std::string extension = without_last_slash(out).extension().string();
  return extension == ".zip" || extension == ".ozx";
}

fs::path staging_path(const fs::path& out) { return without_last_slash(out).string() + ".partial"; }

ConvertStaging::ConvertStaging(fs::path out, bool resume, bool force, std::vector<fs::path> inputs)
    : out_(checked_name(std::move(out))),
      staging_(staging_path(out_)),
      aside_(set_aside_name(out_)),
      zip_(is_zip_name(out_)),
      force_(force),
      inputs_(std::move(inputs)),
      parent_(parent_of(out_)) {
  end_publication(resume);
  check_out(resume);
  prepare(resume);
}

void ConvertStaging::check_zip() const {
  check_output(out_.string(), force_);
  check_replaces_no_input(out_, inputs_);
}

void ConvertStaging::end_publication(bool resume) {
  // Where folders change places in three steps, there may have been time for the first only.
  if (!is_there(out_) && has_marker(staging_) && is_folder(aside_) &&
      why_not_our_store(aside_).empty())
    parent_.rename_file(aside_, out_);
  const bool unfinished = has_marker(out_) && !has_marker(staging_);
  const bool journal_left = !has_marker(out_) && is_there(out_ / kConvertJournal);
  if (!(unfinished || journal_left) || !why_not_our_store(out_).empty()) return;
  if (journal_left) return parent_.remove_file(out_ / kConvertJournal);
  lock_ = lock_folder(parent_, out_);
  remove_replaced(aside_);
  remove_replaced(staging_);
  parent_.sync_folder(parent_.root());
  if (resume) return parent_.rename_file(out_, staging_);
  parent_.remove_file(out_ / kLayoutMarker);
  parent_.remove_file(out_ / kConvertJournal);
  lock_ = UniqueFd();
}

/// Removes the rest of a store that a new one has replaced.
void ConvertStaging::remove_replaced(const fs::path& folder) const {
  check_replaceable(folder, StoreEntries::of(folder), "", inputs_);
  parent_.remove_folder(folder);
}

void ConvertStaging::check_out(bool resume) const {
  if (!is_there(out_)) return;
  if (fs::is_symlink(fs::symlink_status(out_)))
    throw UsageError(
        fmt::format("'{}' is a symbolic link; name the folder that it means", out_.string()));
  if (!force_ && resume && has_marker(staging_))
    throw UsageError(fmt::format("'{}' exists; --resume --force goes on with '{}' and replaces it",
                                 out_.string(), staging_.string()));
  if (!force_)
    throw UsageError(fmt::format("'{}' exists{}; --force replaces it", out_.string(),
                                 resume ? ", so that there is nothing to resume" : ""));
  if (zip_) return check_zip();
  if (const std::string why = why_not_our_store(out_); !why.empty())
    throw UsageError(
        fmt::format("'{}' is no store that --force replaces: {}; choose another name or move it "
                    "away",
                    out_.string(), why));
  check_replaces_no_input(out_, inputs_);
}

void ConvertStaging::prepare(bool resume) {
  if (is_there(staging_) && !is_folder(staging_))
    throw UsageError(fmt::format("'{}' is in the way", staging_.string()));
  if (lock_.get() < 0) lock_ = lock_folder(parent_, staging_);
  const bool begun = has_marker(staging_);
  resumed_ = resume && begun;
  if (resumed_ || fs::is_empty(staging_)) return;
  // Whatever else is there, no conversion left it: it is not ours to remove.
  if (!begun && !nothing_to_resume(staging_))
    throw UsageError(
        fmt::format("'{}' is in the way and is no interrupted conversion; move it elsewhere",
                    staging_.string()));
  if (!resume && !force_)
    throw UsageError(
        fmt::format("an interrupted conversion is in '{}'; --resume goes on with it, "
                    "--force starts anew",
                    staging_.string()));
  if (begun) {
    const StoreEntries store = StoreEntries::of(staging_);
    check_replaceable(staging_, store, "", inputs_);
    if (!store.why().empty())
      throw UsageError(
          fmt::format("'{}' is not replaced: {}; move it away", staging_.string(), store.why()));
  }
  clear(true);
}

/// Empties the staging folder; its marker goes last, if at all, so that the next run knows what is
/// left.
void ConvertStaging::clear(bool marker) const {
  for (const FolderEntry& entry : folder_entries(staging_))
    if (entry.name != kLayoutMarker) parent_.remove_folder(staging_ / entry.name);
  if (marker) parent_.remove_file(staging_ / kLayoutMarker);
}

void ConvertStaging::publish(Progress& progress) {
  check_out(false);  // it may have appeared since
  if (!zip_) return parent_.replace_folder(staging_, out_);
  write_zip(progress);
  clear(false);
}

void ConvertStaging::write_zip(Progress& progress) const {
  OutputFile file(out_.string(), force_);
  const auto wanted = [](const std::string& key) {
    return key != kLayoutMarker && key != kConvertJournal && !is_temporary_name(key);
  };
  v0::write_zip(*folder_storage(staging_), wanted, file.writer(), progress);
  file.publish();
  parent_.sync_folder(parent_.root());
}

void ConvertStaging::finish() const {
  if (zip_) parent_.remove_folder(staging_);
}

}  // namespace isobrick
