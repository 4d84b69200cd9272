#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include <isobrick/progress.h>
#include "io/bytes/leftovers.h"
#include "pipeline/upload/file_upload.h"
#include "pipeline/upload/store_upload.h"

namespace isobrick::tools {

/// A folder among the temporary files, which goes in the end.
class ScratchFolder {
 public:
  ScratchFolder();
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  std::filesystem::path path() const { return temporary_.path; }

 private:
  Temporary temporary_;
};

/// A store that a command writes to s3://BUCKET/PATH: it grows in the folder of temporary files.
class BucketOutput {
 public:
  /// Throws UsageError for another URL or a zip, and what StoreUpload does: before any work.
  BucketOutput(const std::string& url, bool force, std::uint64_t memory);

  /// Where the store is to be made.
  std::filesystem::path folder() const { return scratch_.path() / "store.zarr"; }
  void upload(Progress& progress) { upload_.run(folder(), progress); }

 private:
  StoreUpload upload_;
  ScratchFolder scratch_;
};

/// A file that a command writes to s3://BUCKET/PATH/NAME, with files that it puts beside it.
class BucketFile {
 public:
  /// Throws UsageError for another URL, and what FileUpload does: before any work.
  BucketFile(const std::string& url, bool force, std::uint64_t memory);

  /// Where the file is to be made.
  std::filesystem::path path() const { return scratch_.path() / upload_.name(); }
  void upload(Progress& progress);

 private:
  FileUpload upload_;
  ScratchFolder scratch_;
};

}  // namespace isobrick::tools
