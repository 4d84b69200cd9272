#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <isobrick/upload.h>
#include "bricks/storage/s3_writer.h"

namespace isobrick::inline v0 {

/// An upload of a store, whose place is looked at before the store is made: upload_store().
class StoreUpload {
 public:
  /// Throws what upload_store() does of the place.
  StoreUpload(const std::string& url, const UploadOptions& options);

  std::uint64_t run(const std::filesystem::path& folder, Progress& progress);

 private:
  void check_place(bool force) const;

  std::string url_;
  std::stop_token cancel_;
  S3Writer writer_;
  std::vector<std::string> keys_;  ///< of what is there
};

}  // namespace isobrick
