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
  /// Uploads files, each under its own name beside the object of the URL. Returns their bytes.
  std::uint64_t run(const std::vector<std::filesystem::path>& files, Progress& progress);
  /// Uploads a file as the object of the URL.
  std::uint64_t run(const std::filesystem::path& file, Progress& progress);

 private:
  struct Object {
    std::string key;
    std::filesystem::path file;
  };
  void check_absent(const std::string& key);
  std::uint64_t put(const std::vector<Object>& objects, Progress& progress);

  std::string name_;
  bool force_;
  std::stop_token cancel_;
  S3Writer writer_;
};

}  // namespace isobrick
