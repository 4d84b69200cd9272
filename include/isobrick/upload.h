#pragma once

#include <cstdint>
#include <filesystem>
#include <stop_token>
#include <string>

#include <isobrick/api.h>
#include <isobrick/progress.h>

namespace isobrick::inline v0 {

/// How a store is uploaded.
struct UploadOptions {
  bool force = false;                               ///< replace a store that is there
  std::uint64_t memory = std::uint64_t{256} << 20;  ///< bytes on their way at most; 16 MiB at least
  int max_requests = 16;                            ///< under way at the same time
  int tries = 7;                                    ///< of each request, as RemoteOptions::tries
  double timeout_seconds = 30;                      ///< without a connection or a byte
  /// Ends the operation with Cancelled, soon after a stop is requested on any thread.
  std::stop_token cancel = {};
};

/// Writes the store in `folder` as the objects below s3://BUCKET/PATH, with the credentials that
/// remote_storage() takes. Objects above 64 MiB go in parts. The metadata of the root come last: a
/// store that is not whole cannot be opened. Where an upload ends early, its parts are removed, and
/// whole objects stay; the next one with `force` replaces them.
///
/// `force` first removes the metadata of the root, and objects that the new store does not have at
/// the end. Throws UsageError for a URL of another kind, where `folder` is no store, where anything
/// is below the URL and `force` is not set, and where that is something that a store of ours does
/// not have. Throws Error where the server refuses. Returns the bytes of all objects.
ISOBRICK_API std::uint64_t upload_store(const std::filesystem::path& folder, const std::string& url,
                                        const UploadOptions& options = {},
                                        Progress& progress = no_progress());

/// Writes a file as the object s3://BUCKET/PATH/NAME, which appears once it is whole; large files
/// go in parts. Throws UsageError for another URL, and where the object is there and `force` is not
/// set; Error where the file cannot be read or the server refuses. Returns the bytes.
ISOBRICK_API std::uint64_t upload_file(const std::filesystem::path& file, const std::string& url,
                                       const UploadOptions& options = {},
                                       Progress& progress = no_progress());

}  // namespace isobrick
