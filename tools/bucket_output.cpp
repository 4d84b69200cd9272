#include "tools/bucket_output.h"

#include <algorithm>
#include <system_error>

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

const std::string& checked(const std::string& url) {
  if (!url.starts_with("s3://")) refuse_url_output(url);
  if (is_zip_name(url))
    throw UsageError(fmt::format(
        "'{}': a zip is not written to a bucket; name the store .zarr, which readers of a bucket "
        "read as well",
        url));
  return url;
}

}  // namespace

BucketOutput::BucketOutput(const std::string& url, bool force, std::uint64_t memory)
    : upload_(checked(url), upload_options(force, memory)) {
  const std::string name = (temporary_folder() / "isobrick").string();
  remove_leftovers(name, true);
  temporary_ = create_temporary_folder(name);
}

BucketOutput::~BucketOutput() {
  std::error_code ignored;
  std::filesystem::remove_all(temporary_.path, ignored);
}

std::filesystem::path BucketOutput::folder() const {
  return std::filesystem::path(temporary_.path) / "store.zarr";
}

void BucketOutput::upload(Progress& progress) { upload_.run(folder(), progress); }

}  // namespace isobrick::tools
