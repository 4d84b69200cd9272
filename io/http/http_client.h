#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

namespace isobrick::inline v0 {

/// Part of an object.
struct ByteRange {
  std::uint64_t offset = 0, size = 0;
  std::uint64_t end() const { return offset + size; }
};

/// A request of HTTP.
struct HttpRequest {
  std::string method = "GET";  ///< GET, PUT, POST or DELETE
  std::string url;             ///< percent-encoded
  std::vector<std::string> headers;
  std::optional<ByteRange> range;  ///< of the object, for GET
  /// Bytes of the reply at most; more are an error.
  std::uint64_t max_body = std::uint64_t{16} << 20;
  std::vector<std::byte> body;  ///< of PUT and POST
};

/// A reply that is no temporary failure.
struct HttpReply {
  int status = 0;
  std::map<std::string, std::string> headers;  ///< names in lower case
  std::vector<std::byte> body;

  /// The value of a header, or "".
  const std::string& header(const std::string& name) const;
};

/// How requests are signed for S3.
struct S3Credentials {
  std::string access_key, secret_key, session_token, region;
};

/// How requests are sent.
struct HttpOptions {
  int max_requests = 32;            ///< under way at the same time
  int tries = 7;                    ///< of each request, where it fails for a while
  double timeout_seconds = 30;      ///< without a connection or a byte
  std::stop_token cancel = {};      ///< ends requests with Cancelled
  std::optional<S3Credentials> s3;  ///< nullopt: requests are not signed
};

/// Sends requests, many at a time, from one thread of its own. Temporary failures are tried again,
/// with longer and longer pauses. Thread-safe.
class HttpClient {
 public:
  /// Called on the client's thread, once for each request, with a reply or an Error.
  using Done = std::function<void(HttpReply reply, std::exception_ptr error)>;

  /// Destroying a client ends its requests with Cancelled.
  virtual ~HttpClient() = default;
  /// Begins a request.
  virtual void send(HttpRequest request, Done done) = 0;
  /// Calls `function` on the client's thread after a pause.
  virtual void call_after(std::chrono::milliseconds pause, std::function<void()> function) = 0;
};

/// Sends one request and waits for its reply. Throws what `done` of HttpClient::send() gets.
HttpReply fetch(HttpClient& client, HttpRequest request);

/// What isobrick_curl.so returns (io/bytes/module.h).
struct CurlModule {
  const char* version;
  std::unique_ptr<HttpClient> (*make_client)(const HttpOptions& options);
};

/// A client of libcurl. Throws Error where this was built without it, and what load_module() does.
std::unique_ptr<HttpClient> make_http_client(const HttpOptions& options);

/// "404 Not Found".
std::string status_text(int status);

}  // namespace isobrick
