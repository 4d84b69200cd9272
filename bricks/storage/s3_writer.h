#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include <isobrick/progress.h>
#include "bricks/storage/remote_url.h"
#include "io/bytes/file.h"
#include "io/http/http_client.h"

namespace isobrick::inline v0 {

/// Writes objects below an s3:// URL, several at a time, large ones in parts. Used by one thread.
/// Failures come out of the next call as Error; the object of a failure does not appear.
class S3Writer {
 public:
  /// Bytes that wait for the network take `memory` at most, 16 MiB at least.
  S3Writer(RemotePlace place, const HttpOptions& options, std::uint64_t memory);
  /// Ends what is not finished: uploads in parts are aborted, so that no bucket keeps their parts.
  ~S3Writer();
  S3Writer(const S3Writer&) = delete;
  S3Writer& operator=(const S3Writer&) = delete;

  /// How messages name the place: the URL.
  const std::string& name() const { return place_.name; }
  /// The keys of all objects below the place, without its own.
  std::vector<std::string> list();
  /// Whether there is such an object.
  bool has(const std::string& key);
  /// Begins to write an object, and waits for room for its bytes. `progress` hears of bytes that
  /// the server has, of this object and of others.
  void put(const std::string& key, const File& file, Progress& progress);
  /// Begins to remove an object; one that is not there is none the worse.
  void remove(const std::string& key);
  /// Returns when all that was begun is done.
  void wait(Progress& progress);

 private:
  struct Parts;
  using PartsPtr = std::shared_ptr<Parts>;

  std::string url_of(const std::string& key) const;
  void send(HttpRequest request, std::function<void(const HttpReply&)> done);
  std::vector<std::byte> read(const File& file, std::uint64_t offset, std::uint64_t size,
                              Progress& progress);
  void put_parts(const std::string& key, const File& file, std::uint64_t size, Progress& progress);
  void complete(const PartsPtr& parts);
  void check_size(const PartsPtr& parts);
  void abort_parts();
  void report(std::unique_lock<std::mutex>& lock, Progress& progress);

  RemotePlace place_;
  HttpOptions options_;
  std::uint64_t memory_, part_bytes_, max_single_bytes_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::uint64_t in_flight_ = 0;  ///< bytes
  std::uint64_t done_ = 0;       ///< bytes that no progress has heard of
  std::size_t pending_ = 0;      ///< requests
  std::exception_ptr failure_;
  std::set<PartsPtr> open_;  ///< not complete
  std::unique_ptr<HttpClient> client_;
};

}  // namespace isobrick
