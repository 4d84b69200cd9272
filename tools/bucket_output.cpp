#include "tools/bucket_output.h"

#include <algorithm>
#include <system_error>
#include <vector>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "pipeline/convert/convert_staging.h"
#include "tools/output_name.h"

namespace isobrick::tools {
namespace {

/// What waits for the network takes a part of the budget, and no more than helps.
UploadOptions upload_options(bool force, std::uint64_t memory) {
  UploadOptions options;
  options.force = force;
  options.memory = std::min(options.memory, memory / 4);
  return options;
}

const std::string& of_bucket(const std::string& url) {
  if (!url.starts_with("s3://")) refuse_url_output(url);
  return url;
}

const std::string& checked(const std::string& url) {
  of_bucket(url);
  if (is_zip_name(url))
    throw UsageError(fmt::format(
        "'{}': a zip is not written to a bucket; name the store .zarr, which readers of a bucket "
        "read as well",
        url));
  return url;
}

}  // namespace

ScratchFolder::ScratchFolder() {
  const std::string name = (temporary_folder() / "isobrick").string();
  remove_leftovers(name, true);
  temporary_ = create_temporary_folder(name);
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(temporary_.path, ignored);
}

BucketOutput::BucketOutput(const std::string& url, bool force, std::uint64_t memory)
    : upload_(checked(url), upload_options(force, memory)) {}

BucketFile::BucketFile(const std::string& url, bool force, std::uint64_t memory)
    : upload_(of_bucket(url), upload_options(force, memory)) {}

void BucketFile::upload(Progress& progress) {
  std::vector<std::filesystem::path> beside;
  for (const auto& entry : std::filesystem::directory_iterator(scratch_.path()))
    if (entry.path() != path()) beside.push_back(entry.path());
  upload_.run(path(), beside, progress);
}

}  // namespace isobrick::tools
