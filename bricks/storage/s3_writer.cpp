#include "bricks/storage/s3_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <string_view>
#include <utility>

#include <isobrick/error.h>
#include "bricks/storage/s3_xml.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::uint64_t kOneMiB = std::uint64_t{1} << 20;
/// S3 takes no smaller part but the last, and no more parts of an object.
constexpr std::uint64_t kMinPart = 5 * kOneMiB, kMaxPart = 16 * kOneMiB, kMaxPartCount = 10000;
/// Larger objects are written in parts.
constexpr std::uint64_t kMaxSingle = 64 * kOneMiB;

std::string text_of(const HttpReply& reply) {
  return {reinterpret_cast<const char*>(reply.body.data()), reply.body.size()};
}

std::vector<std::byte> bytes_of(std::string_view text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

[[noreturn]] void refuse(const std::string& name, const HttpReply& reply) {
  const std::string text = text_of(reply);
  std::string why = status_text(reply.status);
  for (const char* element : {"Code", "Message"}) {
    std::size_t at = 0;
    if (const auto found = next_element(text, element, at)) why += ", " + *found;
  }
  if (!reply.header("x-amz-bucket-region").empty())
    why += "; set AWS_REGION=" + reply.header("x-amz-bucket-region");
  else if (reply.status == 403)
    why += "; check the credentials";
  throw Error(fmt::format("cannot write '{}': {}", name, why));
}

}  // namespace

/// An object that is written in parts.
struct S3Writer::Parts {
  std::string name, url, id;
  std::uint64_t size = 0;
  std::vector<std::string> etags;
  std::size_t left = 0;  ///< parts that the server does not have
};

S3Writer::S3Writer(RemotePlace place, const HttpOptions& options, std::uint64_t memory)
    : place_(std::move(place)),
      options_(options),
      memory_(std::max(memory, 16 * kOneMiB)),
      part_bytes_(std::clamp(memory_ / 4, kMinPart, kMaxPart)),
      max_single_bytes_(std::min(kMaxSingle, memory_ / 2)) {
  options_.s3 = place_.s3;
  client_ = make_http_client(options_);
}

S3Writer::~S3Writer() {
  client_.reset();  // its replies use the rest
  abort_parts();
}

void S3Writer::abort_parts() {
  if (open_.empty()) return;
  try {
    HttpOptions options = options_;
    options.cancel = {};
    options.tries = std::min(options.tries, 3);
    options.timeout_seconds = std::min(options.timeout_seconds, 10.);
    const auto client = make_http_client(options);
    for (const PartsPtr& parts : open_)
      fetch(*client, {.method = "DELETE", .url = parts->url + "?uploadId=" + parts->id});
  } catch (const std::exception&) {
    // The bucket's own rules remove them.
  }
}

std::string S3Writer::url_of(const std::string& key) const {
  return place_.base + '/' + percent_encode(key, true);
}

std::vector<std::string> S3Writer::list() {
  std::vector<std::string> keys;
  std::string next;
  do {
    std::string url = place_.list_url + '?';
    // In the order of the alphabet, as the signature wants them.
    if (!next.empty()) url += "continuation-token=" + percent_encode(next, false) + '&';
    url += "list-type=2&prefix=" + percent_encode(place_.list_prefix, false);
    const HttpReply reply = fetch(*client_, {.url = url});
    if (reply.status != 200) refuse(place_.name, reply);
    S3Listing part = parse_s3_listing(text_of(reply), place_.list_prefix);
    std::move(part.names.begin(), part.names.end(), std::back_inserter(keys));
    next = std::move(part.next);
  } while (!next.empty());
  return keys;
}

bool S3Writer::has(const std::string& key) {
  const HttpReply reply =
      fetch(*client_, {.url = url_of(key), .range = ByteRange{0, 1}, .max_body = 1});
  if (reply.status == 404) return false;
  // An empty object has no first byte.
  if (reply.status != 200 && reply.status != 206 && reply.status != 416)
    refuse(place_.name + '/' + key, reply);
  return true;
}

/// Calls `done` with the reply, on the client's thread. What it throws is a failure.
void S3Writer::send(HttpRequest request, std::function<void(const HttpReply&)> done) {
  const std::uint64_t bytes = request.method == "PUT" ? request.body.size() : 0;
  {
    const std::lock_guard lock(mutex_);
    ++pending_;
  }
  client_->send(std::move(request), [this, bytes, done = std::move(done)](
                                        const HttpReply& reply, std::exception_ptr failure) {
    try {
      if (!failure) done(reply);
    } catch (const Error&) {
      failure = std::current_exception();
    }
    const std::lock_guard lock(mutex_);
    in_flight_ -= bytes;
    --pending_;
    if (!failure)
      done_ += bytes;
    else if (!failure_)
      failure_ = failure;
    changed_.notify_all();
  });
}

/// Waits a moment, and reports what was done until then. Throws a failure.
void S3Writer::report(std::unique_lock<std::mutex>& lock, Progress& progress) {
  using namespace std::chrono_literals;
  changed_.wait_for(lock, 100ms);
  if (failure_) std::rethrow_exception(failure_);
  const std::uint64_t done = std::exchange(done_, 0);
  lock.unlock();
  progress.advance(done);  // which may throw Cancelled
  lock.lock();
}

void S3Writer::wait(Progress& progress) {
  std::unique_lock lock(mutex_);
  while (pending_ > 0) report(lock, progress);
  if (failure_) std::rethrow_exception(failure_);
  const std::uint64_t done = std::exchange(done_, 0);
  lock.unlock();
  progress.advance(done);
}

/// Bytes of a file, once there is room for them.
std::vector<std::byte> S3Writer::read(const File& file, std::uint64_t offset, std::uint64_t size,
                                      Progress& progress) {
  {
    std::unique_lock lock(mutex_);
    while (in_flight_ > 0 && in_flight_ + size > memory_) report(lock, progress);
    if (failure_) std::rethrow_exception(failure_);
    in_flight_ += size;
  }
  std::vector<std::byte> bytes(size);
  file.read_at(offset, bytes);
  return bytes;
}

void S3Writer::put(const std::string& key, const File& file, Progress& progress) {
  const std::uint64_t size = file.size();
  if (size > max_single_bytes_) return put_parts(key, file, size, progress);
  send({.method = "PUT", .url = url_of(key), .body = read(file, 0, size, progress)},
       [name = place_.name + '/' + key](const HttpReply& reply) {
         if (reply.status != 200) refuse(name, reply);
       });
}

void S3Writer::put_parts(const std::string& key, const File& file, std::uint64_t size,
                         Progress& progress) {
  const auto parts = std::make_shared<Parts>();
  parts->name = place_.name + '/' + key;
  parts->url = url_of(key);
  parts->size = size;
  const HttpReply begun = fetch(*client_, {.method = "POST", .url = parts->url + "?uploads="});
  std::size_t at = 0;
  const auto id = next_element(text_of(begun), "UploadId", at);
  if (begun.status != 200 || !id) refuse(parts->name, begun);
  parts->id = percent_encode(*id, false);
  const std::uint64_t part = std::max(part_bytes_, (size + kMaxPartCount - 1) / kMaxPartCount);
  parts->left = static_cast<std::size_t>((size + part - 1) / part);
  parts->etags.resize(parts->left);
  {
    const std::lock_guard lock(mutex_);
    open_.insert(parts);
  }
  const std::size_t count = parts->left;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint64_t offset = i * part;
    send({.method = "PUT",
          .url = fmt::format("{}?partNumber={}&uploadId={}", parts->url, i + 1, parts->id),
          .body = read(file, offset, std::min(part, size - offset), progress)},
         [this, parts, i](const HttpReply& reply) {
           if (reply.status != 200 || reply.header("etag").empty()) refuse(parts->name, reply);
           parts->etags[i] = reply.header("etag");
           if (--parts->left == 0) complete(parts);
         });
  }
}

/// On the client's thread: makes an object of its parts.
void S3Writer::complete(const PartsPtr& parts) {
  std::string xml = "<CompleteMultipartUpload>";
  for (std::size_t i = 0; i < parts->etags.size(); ++i)
    xml += fmt::format("<Part><PartNumber>{}</PartNumber><ETag>{}</ETag></Part>", i + 1,
                       parts->etags[i]);
  xml += "</CompleteMultipartUpload>";
  send({.method = "POST", .url = parts->url + "?uploadId=" + parts->id, .body = bytes_of(xml)},
       [this, parts](const HttpReply& reply) {
         // The reply to an earlier try may be lost: then there is no such upload any more.
         if (reply.status == 404) return check_size(parts);
         // A failure that came late has status 200 and is told by the text.
         if (reply.status != 200 ||
             text_of(reply).find("<CompleteMultipartUploadResult") == std::string::npos)
           refuse(parts->name, reply);
         const std::lock_guard lock(mutex_);
         open_.erase(parts);
       });
}

/// Whether the object is there, as long as it must be.
void S3Writer::check_size(const PartsPtr& parts) {
  send({.url = parts->url, .range = ByteRange{parts->size - 1, 1}, .max_body = 1},
       [this, parts](const HttpReply& reply) {
         if (!reply.header("content-range").ends_with(fmt::format("/{}", parts->size)))
           refuse(parts->name, reply);
         const std::lock_guard lock(mutex_);
         open_.erase(parts);
       });
}

void S3Writer::remove(const std::string& key) {
  send({.method = "DELETE", .url = url_of(key)},
       [name = place_.name + '/' + key](const HttpReply& reply) {
         if (reply.status != 200 && reply.status != 204 && reply.status != 404) refuse(name, reply);
       });
}

}  // namespace isobrick
