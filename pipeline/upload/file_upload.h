#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <isobrick/upload.h>
#include "bricks/storage/s3_writer.h"

namespace isobrick::inline v0 {

/// An upload of files, whose place is looked at before they are made: upload_file().
class FileUpload {
 public:
  /// Throws what upload_file() does of the place.
  FileUpload(const std::string& url, const UploadOptions& options);

  /// The name of the object within its place.
  const std::string& name() const { return name_; }
  /// Uploads a file as the object of the URL, and others beside it under their own names. Returns
  /// their bytes.
  std::uint64_t run(const std::filesystem::path& file,
                    const std::vector<std::filesystem::path>& beside, Progress& progress);

 private:
  void check_absent(const std::string& key);

  std::string name_;
  bool force_;
  std::stop_token cancel_;
  S3Writer writer_;
};

}  // namespace isobrick
