#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include <isobrick/progress.h>
#include "io/bytes/leftovers.h"
#include "pipeline/upload/store_upload.h"

namespace isobrick::tools {

/// A store that a command writes to s3://BUCKET/PATH: it grows in the folder of temporary files.
class BucketOutput {
 public:
  /// Throws UsageError for another URL or a zip, and what StoreUpload does: before any work.
  BucketOutput(const std::string& url, bool force, std::uint64_t memory);
  /// Removes the folder.
  ~BucketOutput();
  BucketOutput(const BucketOutput&) = delete;
  BucketOutput& operator=(const BucketOutput&) = delete;

  /// Where the store is to be made.
  std::filesystem::path folder() const;
  void upload(Progress& progress);

 private:
  StoreUpload upload_;
  Temporary temporary_;
};

}  // namespace isobrick::tools
