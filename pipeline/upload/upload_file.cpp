#include <isobrick/upload.h>

#include <utility>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "core/cancellable_progress.h"
#include "pipeline/upload/file_upload.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// The name of the object that a URL names; throws where it names none.
std::string object_name(const std::string& url) {
  constexpr std::string_view scheme = "s3://";
  if (!url.starts_with(scheme))
    throw UsageError(fmt::format("'{}': files are uploaded to s3://BUCKET/PATH only", url));
  const std::size_t slash = url.rfind('/');
  if (slash < scheme.size() || slash + 1 == url.size())
    throw UsageError(
        fmt::format("'{}' names no object: add its name, such as s3://BUCKET/PATH/head.nrrd", url));
  return url.substr(slash + 1);
}

RemotePlace place_around(const std::string& url) {
  return parse_remote_url(url.substr(0, url.rfind('/')), process_environment());
}

}  // namespace

FileUpload::FileUpload(const std::string& url, const UploadOptions& options)
    : name_(object_name(url)),
      force_(options.force),
      cancel_(options.cancel),
      writer_(place_around(url),
              {.max_requests = options.max_requests,
               .tries = options.tries,
               .timeout_seconds = options.timeout_seconds,
               .cancel = options.cancel},
              options.memory) {
  check_absent(name_);
}

void FileUpload::check_absent(const std::string& key) {
  if (!force_ && writer_.has(key))
    throw UsageError(fmt::format("'{}/{}' exists; --force replaces it", writer_.name(), key));
}

std::uint64_t FileUpload::run(const fs::path& file, const std::vector<fs::path>& beside,
                              Progress& listener) {
  CancellableProgress progress(listener, cancel_);
  std::vector<std::pair<std::string, File>> objects;
  for (const fs::path& other : beside) {
    objects.emplace_back(other.filename().string(), open_input(other));
    check_absent(objects.back().first);
  }
  objects.emplace_back(name_, open_input(file));
  std::uint64_t bytes = 0;
  for (const auto& [key, from] : objects) bytes += from.size();
  progress.begin("upload", bytes);
  for (const auto& [key, from] : objects) writer_.put(key, from, progress);
  writer_.wait(progress);
  progress.end();
  return bytes;
}

std::uint64_t upload_file(const fs::path& file, const std::string& url,
                          const UploadOptions& options, Progress& progress) {
  return FileUpload(url, options).run(file, {}, progress);
}

}  // namespace isobrick
