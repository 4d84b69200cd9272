#include <isobrick/upload.h>

#include <algorithm>
#include <array>
#include <set>
#include <string_view>

#include <fmt/format.h>

#include <isobrick/error.h>
#include <isobrick/storage.h>
#include <isobrick/store_reader.h>
#include "bricks/zarr/metadata_files.h"
#include "core/cancellable_progress.h"
#include "io/bytes/folder_walk.h"
#include "pipeline/upload/store_upload.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// Metadata of a root in the order in which they are written: what names the levels comes last.
constexpr std::array<std::string_view, 4> kRootFiles{".zgroup", ".zarray", ".zattrs", "zarr.json"};

bool is_root_key(std::string_view key) {
  return std::ranges::find(kRootFiles, key) != kRootFiles.end();
}

/// Whether a store of ours may have an object of this key: metadata, chunks of a level, and all
/// below isobrick/.
bool may_be_of_store(std::string_view key) {
  if (key.starts_with("isobrick/")) return true;
  for (bool is_first = true; !key.empty(); is_first = false) {
    const std::size_t slash = std::min(key.find('/'), key.size());
    const std::string_view part = key.substr(0, slash);
    const bool is_last = slash == key.size();
    const bool is_number = !part.empty() && part.find_first_not_of("0123456789") == part.npos;
    if (!is_number && !(part == "c" && !is_first && !is_last) && !(is_last && is_root_key(part)))
      return false;
    key.remove_prefix(is_last ? slash : slash + 1);
  }
  return true;
}

RemotePlace place_of(const std::string& url) {
  if (!url.starts_with("s3://"))
    throw UsageError(fmt::format("'{}': stores are uploaded to s3://BUCKET/PATH only", url));
  RemotePlace place = parse_remote_url(url, process_environment());
  if (place.list_prefix.empty())
    throw UsageError(
        fmt::format("'{}' is a whole bucket: name a store in it, such as {}/volume.zarr",
                    place.name, place.name));
  return place;
}

}  // namespace

StoreUpload::StoreUpload(const std::string& url, const UploadOptions& options)
    : url_(url),
      cancel_(options.cancel),
      writer_(place_of(url),
              {.max_requests = options.max_requests,
               .tries = options.tries,
               .timeout_seconds = options.timeout_seconds,
               .cancel = options.cancel},
              options.memory),
      keys_(writer_.list()) {
  check_place(options.force);
}

void StoreUpload::check_place(bool force) const {
  if (keys_.empty()) return;
  if (!force) throw UsageError(fmt::format("'{}' exists; --force replaces it", writer_.name()));
  for (const std::string& key : keys_)
    if (!may_be_of_store(key))
      throw UsageError(fmt::format("'{}' has '{}', which is of no store: it is not replaced",
                                   writer_.name(), key));
  if (std::ranges::none_of(keys_, is_root_key)) return;  // of an upload that ended early
  bool is_ours = false;
  try {
    is_ours = StoreReader(fs::path(url_)).info().ours;
  } catch (const Error&) {
  }
  if (!is_ours)
    throw UsageError(
        fmt::format("'{}' is no store of Isobrick: it is not replaced", writer_.name()));
}

std::uint64_t StoreUpload::run(const fs::path& folder, Progress& listener) {
  CancellableProgress progress(listener, cancel_);
  if (!is_zarr(folder) || !fs::is_directory(folder))
    throw UsageError(fmt::format("'{}' is no folder of a store", folder.string()));
  std::set<std::string> keys;
  std::uint64_t bytes = 0;
  walk_folder(folder, [&](const fs::path& file, fs::file_type type) {
    if (type != fs::file_type::regular) return true;
    keys.insert(file.generic_string());
    bytes += fs::file_size(folder / file);
    return true;
  });
  progress.begin("upload", bytes);
  // Nobody opens a store while its objects are replaced.
  for (const std::string& key : keys_)
    if (is_root_key(key)) writer_.remove(key);
  writer_.wait(progress);
  for (const std::string& key : keys)
    if (!is_root_key(key)) writer_.put(key, open_input(folder / key), progress);
  for (const std::string& key : keys_)
    if (!keys.contains(key) && !is_root_key(key)) writer_.remove(key);
  writer_.wait(progress);
  for (const std::string_view name : kRootFiles)
    if (const std::string key(name); keys.contains(key)) {
      writer_.put(key, open_input(folder / key), progress);
      writer_.wait(progress);
    }
  progress.end();
  return bytes;
}

std::uint64_t upload_store(const fs::path& folder, const std::string& url,
                           const UploadOptions& options, Progress& progress) {
  return StoreUpload(url, options).run(folder, progress);
}

}  // namespace isobrick
