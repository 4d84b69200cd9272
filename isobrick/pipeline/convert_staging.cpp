#include "isobrick/pipeline/convert_staging.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>

#include "isobrick/bricks/store_file.h"
#include "isobrick/bricks/store_names.h"
#include "isobrick/core/error.h"
#include "isobrick/pipeline/replace_folder.h"

namespace isobrick {
namespace {

namespace fs = std::filesystem;

bool is_there(const fs::path& path) {
  return fs::symlink_status(path).type() != fs::file_type::not_found;
}

/// A Zarr group (or an empty folder): something that is ours to replace.
bool is_store(const fs::path& path) {
  return fs::is_directory(path) && (fs::is_empty(path) || fs::exists(path / "zarr.json") ||
                                    (fs::exists(path / ".zgroup") && fs::exists(path / ".zattrs")));
}

/// Whether a conversion stopped before its first file, the marker, was whole.
bool nothing_to_resume(const fs::path& staging) {
  for (const fs::directory_entry& entry : fs::directory_iterator(staging))
    if (!is_temporary_name(entry.path()) || entry.path().stem() != kLayoutMarker) return false;
  return true;
}

}  // namespace

ConvertStaging::ConvertStaging(fs::path out, bool resume, bool force)
    : out_(std::move(out)), force_(force) {
  if (!out_.has_filename()) out_ = out_.parent_path();  // a slash at the end
  if (out_.empty() || out_.filename() == "." || out_.filename() == "..")
    throw UsageError(fmt::format("'{}' is no name for a store", out_.string()));
  staging_ = out_;
  staging_ += ".partial";
  check_out(force);
  prepare(resume, force);
}

void ConvertStaging::check_out(bool force) const {
  if (!is_there(out_)) return;
  if (fs::is_symlink(fs::symlink_status(out_)))
    throw UsageError(
        fmt::format("'{}' is a symbolic link; name the folder that it means", out_.string()));
  if (!force) throw UsageError(fmt::format("'{}' exists; --force replaces it", out_.string()));
  if (!is_store(out_))
    throw UsageError(fmt::format("'{}' is no store: it is not replaced", out_.string()));
}

void ConvertStaging::prepare(bool resume, bool force) {
  std::error_code failure;
  if (fs::create_directory(staging_, failure)) {
    lock();
    return;
  }
  if (failure) throw system_error("create", staging_.string(), failure.value());
  if (!fs::is_directory(fs::symlink_status(staging_)))
    throw UsageError(fmt::format("'{}' is in the way", staging_.string()));
  lock();
  const bool begun = is_there(staging_ / kLayoutMarker);
  resumed_ = resume && begun;
  if (resumed_ || fs::is_empty(staging_)) return;
  // Whatever else is there, no conversion left it: it is not ours to remove.
  if (!begun && !nothing_to_resume(staging_))
    throw UsageError(
        fmt::format("'{}' is in the way and is no interrupted conversion; move it elsewhere",
                    staging_.string()));
  if (!resume && !force)
    throw UsageError(
        fmt::format("an interrupted conversion is in '{}'; --resume goes on with it, "
                    "--force starts anew",
                    staging_.string()));
  for (const fs::directory_entry& entry : fs::directory_iterator(staging_))
    fs::remove_all(entry.path());
}

void ConvertStaging::lock() {
  lock_ = UniqueFd(::open(staging_.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
  if (lock_.get() < 0) throw system_error("open", staging_.string(), errno);
  if (::flock(lock_.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
    throw Error(fmt::format("another conversion is writing '{}'", staging_.string()));
}

void ConvertStaging::publish() {
  if (is_there(out_)) check_out(force_);  // it may have appeared since
  replace_folder(staging_, out_);
}

}  // namespace isobrick
