#include "bricks/storage/remote_object.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include <isobrick/error.h>
#include "bricks/storage/storage_keys.h"

namespace isobrick::inline v0 {
namespace {

using namespace std::chrono_literals;

/// Hints that come within it are sent together.
constexpr auto kCollectFor = 2ms;
/// Ranges this close to each other are fetched together: to skip them takes about as long as a
/// request does on a fast link.
constexpr std::uint64_t kMaxGap = std::uint64_t{64} << 10;
/// Bytes of one request. More requests of fewer bytes fill a link better.
constexpr std::uint64_t kMaxRequest = std::uint64_t{4} << 20;
/// Hints that wait for room at most.
constexpr std::size_t kMaxPending = std::size_t{1} << 16;
/// What nobody reads for so long is dropped where there is no room.
constexpr auto kKeepUnread = 10s;

}  // namespace

/// The one that has or will have the byte at `offset`.
RangeFetcher::FetchPtr RangeFetcher::find(const RemoteObject* object, std::uint64_t offset) const {
  const auto ranges = objects_.find(object);
  if (ranges == objects_.end()) return nullptr;
  auto next = ranges->second.upper_bound(offset);
  if (next == ranges->second.begin()) return nullptr;
  const FetchPtr& fetch = std::prev(next)->second;
  return offset < fetch->range.end() ? fetch : nullptr;
}

/// Whether there is room among the ranges of the object: none begins there and is longer.
bool RangeFetcher::add(const FetchPtr& fetch) {
  FetchPtr& place = objects_[fetch->object][fetch->range.offset];
  if (place && place->range.size >= fetch->range.size) return false;
  if (const FetchPtr shorter = place) remove(shorter);
  objects_[fetch->object][fetch->range.offset] = fetch;
  if (fetch->state == State::pending) return true;
  kept_.push_back(fetch);
  bytes_ += fetch->range.size;
  return true;
}

void RangeFetcher::remove(const FetchPtr& fetch) {
  const auto ranges = objects_.find(fetch->object);
  if (ranges == objects_.end()) return;
  const auto found = ranges->second.find(fetch->range.offset);
  if (found == ranges->second.end() || found->second != fetch) return;
  ranges->second.erase(found);
  if (ranges->second.empty()) objects_.erase(ranges);
  if (fetch->state == State::pending) return;
  kept_.remove(fetch);
  bytes_ -= fetch->range.size;
  if (!pending_.empty()) schedule();
}

/// Drops what nobody asked for, and what was done long ago and never read. Whether there is room.
bool RangeFetcher::make_room(std::uint64_t bytes) {
  const Clock::time_point long_ago = Clock::now() - kKeepUnread;
  for (auto at = kept_.begin(); at != kept_.end() && bytes_ + bytes > max_bytes_;) {
    const FetchPtr fetch = *at++;
    const bool is_old = fetch->state == State::done && fetch->done_at < long_ago;
    if (fetch->state == State::failed || fetch->is_spare || is_old) remove(fetch);
  }
  return bytes_ + bytes <= max_bytes_;
}

/// Sends pending fetches soon: hints that come until then may be joined.
void RangeFetcher::schedule() {
  if (std::exchange(is_scheduled_, true)) return;
  client_->call_after(kCollectFor, [weak = weak_from_this()] {
    if (const auto self = weak.lock()) self->send_pending();
  });
}

void RangeFetcher::hint(const std::shared_ptr<const RemoteObject>& object, ByteRange range) {
  if (range.size == 0 || range.size > max_bytes_) return;
  if (object->cached() != nullptr && object->cached()->has(range.offset, range.size)) return;
  const std::lock_guard lock(mutex_);
  const FetchPtr there = find(object.get(), range.offset);
  if (there && range.end() <= there->range.end()) return;
  const auto fetch = std::make_shared<Fetch>(
      Fetch{.object = object.get(), .owner = object, .range = range, .unread = range.size});
  if (pending_.size() >= kMaxPending || !add(fetch)) return;
  pending_.push_back(fetch);
  schedule();
}

void RangeFetcher::keep(const std::shared_ptr<const RemoteObject>& object,
                        std::vector<std::byte> first_bytes) {
  const ByteRange range{0, first_bytes.size()};
  const std::lock_guard lock(mutex_);
  if (range.size == 0 || !make_room(range.size)) return;
  add(std::make_shared<Fetch>(Fetch{.object = object.get(),
                                    .owner = object,
                                    .range = range,
                                    .state = State::done,
                                    .is_spare = true,
                                    .unread = range.size,
                                    .bytes = std::move(first_bytes)}));
}

/// The pending fetches that there is room for, in their order; close ones are joined. They count as
/// sent.
std::vector<RangeFetcher::FetchPtr> RangeFetcher::take_pending() {
  is_scheduled_ = false;
  // Several at a time, so that more of them can be joined.
  if (!make_room(max_bytes_ / 4)) return {};
  std::vector<FetchPtr> taken;
  std::uint64_t bytes = 0;
  for (; !pending_.empty(); pending_.pop_front()) {
    const FetchPtr& next = pending_.front();
    if (next->state != State::pending || find(next->object, next->range.offset) != next) continue;
    if (!make_room(bytes + next->range.size)) break;
    bytes += next->range.size;
    taken.push_back(next);
  }
  std::sort(taken.begin(), taken.end(), [](const FetchPtr& a, const FetchPtr& b) {
    return std::pair(a->object, a->range.offset) < std::pair(b->object, b->range.offset);
  });
  std::vector<FetchPtr> joined;
  for (const FetchPtr& next : taken) {
    remove(next);
    Fetch* const last = joined.empty() ? nullptr : joined.back().get();
    if (last != nullptr && last->object == next->object &&
        next->range.offset <= last->range.end() + kMaxGap &&
        next->range.end() <= last->range.offset + kMaxRequest) {
      last->range.size = std::max(last->range.end(), next->range.end()) - last->range.offset;
      last->unread += next->unread;
    } else {
      joined.push_back(next);
    }
  }
  for (const FetchPtr& fetch : joined) {
    fetch->state = State::sent;
    add(fetch);
  }
  return joined;
}

void RangeFetcher::send_pending() {
  std::vector<FetchPtr> fetches;
  {
    const std::lock_guard lock(mutex_);
    fetches = take_pending();
  }
  for (const FetchPtr& fetch : fetches) send(fetch);
}

void RangeFetcher::send(const FetchPtr& fetch) {
  const auto object = fetch->owner.lock();
  const auto end = [weak = weak_from_this(), fetch](std::vector<std::byte> bytes, State state) {
    const auto self = weak.lock();
    if (!self) return;
    const std::lock_guard lock(self->mutex_);
    fetch->bytes = std::move(bytes);
    fetch->state = state;
    fetch->done_at = Clock::now();
    self->changed_.notify_all();
  };
  if (!object) return end({}, State::failed);
  client_->send(object->request(fetch->range),
                [end, owner = fetch->owner, range = fetch->range](HttpReply reply,
                                                                  const std::exception_ptr& error) {
                  const auto alive = owner.lock();
                  if (error || !alive) return end({}, State::failed);
                  try {
                    end(alive->bytes_of(std::move(reply), range), State::done);
                  } catch (const Error&) {
                    end({}, State::failed);  // reading it says why
                  }
                });
}

/// How many bytes of `out` it filled: 0 where none is kept.
std::size_t RangeFetcher::read_kept(const RemoteObject& object, std::uint64_t offset,
                                    std::span<std::byte> out) {
  std::unique_lock lock(mutex_);
  const FetchPtr fetch = find(&object, offset);
  // A hint still waits for room, but the bytes are needed now.
  if (fetch && fetch->state == State::pending) {
    remove(fetch);
    return 0;
  }
  if (!fetch) return 0;
  changed_.wait(lock, [&] { return fetch->state == State::done || fetch->state == State::failed; });
  // Kept on the disk by the first who reads it: no bytes wait for the disk, and the network goes
  // on.
  if (object.cached() != nullptr && fetch->state == State::done &&
      !std::exchange(fetch->is_cached, true)) {
    lock.unlock();
    object.cached()->write(fetch->range.offset, fetch->bytes);
    lock.lock();
  }
  const std::uint64_t begin = offset - fetch->range.offset;
  const std::uint64_t count = std::min<std::uint64_t>(out.size(), fetch->range.size - begin);
  const bool is_done = fetch->state == State::done;
  if (is_done)
    std::copy_n(fetch->bytes.begin() + static_cast<std::ptrdiff_t>(begin), count, out.begin());
  fetch->unread -= std::min(fetch->unread, count);
  // Small objects, which came as a whole, may be read again.
  const bool is_whole = fetch->is_spare && fetch->range.size == object.size();
  if (!is_done || (fetch->unread == 0 && !is_whole)) remove(fetch);
  return is_done ? static_cast<std::size_t>(count) : 0;
}

/// The same of bytes that the disk has, else of a request that is sent now. Never 0.
std::size_t RangeFetcher::read_now(const RemoteObject& object, std::uint64_t offset,
                                   std::span<std::byte> out) {
  const CachedObject* const cached = object.cached();
  std::uint64_t size = std::min<std::uint64_t>(kMaxRequest, out.size());
  if (cached != nullptr) {
    if (const std::size_t count = cached->read(offset, out)) return count;
    size = cached->missing(offset, size);
  }
  const ByteRange part{offset, size};
  const std::vector<std::byte> bytes = object.bytes_of(fetch(*client_, object.request(part)), part);
  if (cached != nullptr) cached->write(offset, bytes);
  std::copy(bytes.begin(), bytes.end(), out.begin());
  return bytes.size();
}

void RangeFetcher::read(const std::shared_ptr<const RemoteObject>& object, std::uint64_t offset,
                        std::span<std::byte> out) {
  // The requests of a large range are sent side by side.
  if (out.size() > kMaxRequest) object->will_need(offset, out.size());
  while (!out.empty()) {
    std::size_t count = read_kept(*object, offset, out);
    if (count == 0) count = read_now(*object, offset, out);
    offset += count;
    out = out.subspan(count);
  }
}

void RangeFetcher::forget(const RemoteObject& object) {
  const std::lock_guard lock(mutex_);
  const auto ranges = objects_.find(&object);
  if (ranges == objects_.end()) return;
  for (const auto& [offset, fetch] : ranges->second) {
    if (fetch->state == State::pending) continue;
    kept_.remove(fetch);
    bytes_ -= fetch->range.size;
  }
  objects_.erase(ranges);
}

void RemoteObject::read(std::uint64_t offset, std::span<std::byte> bytes) const {
  check_range(*this, offset, bytes.size());
  fetcher_->read(shared_from_this(), offset, bytes);
}

void RemoteObject::will_need(std::uint64_t offset, std::uint64_t size) const {
  if (offset > state_.size || size > state_.size - offset) return;
  // A large range in requests that are sent side by side.
  for (std::uint64_t at = 0; at < size; at += kMaxRequest)
    fetcher_->hint(shared_from_this(), {offset + at, std::min(kMaxRequest, size - at)});
}

HttpRequest RemoteObject::request(ByteRange range) const {
  HttpRequest request{.url = url_, .range = range, .max_body = range.size};
  // A weak tag is no proof of equal bytes.
  if (!state_.etag.empty() && !state_.etag.starts_with("W/"))
    request.headers.push_back("If-Match: " + state_.etag);
  return request;
}

/// Whether a reply names another state than that of the bytes on the disk.
bool RemoteObject::is_of_another_state(const HttpReply& reply) const {
  const auto differs = [&](const char* header, const std::string& known) {
    const std::string& value = reply.header(header);
    return !value.empty() && !known.empty() && value != known;
  };
  return cached_ != nullptr &&
         (differs("etag", state_.etag) || differs("last-modified", state_.last_modified));
}

std::vector<std::byte> RemoteObject::bytes_of(HttpReply reply, ByteRange range) const {
  const auto fail = [&](const std::string& why) {
    throw Error(fmt::format("'{}': bytes {} to {}: {}", name_, range.offset, range.end(), why));
  };
  const bool is_whole = reply.status == 200 && range.offset == 0 && range.size == state_.size;
  if (reply.status == 412 || reply.status == 404 || reply.status == 410 ||
      is_of_another_state(reply)) {
    if (cached_ != nullptr) cached_->forget();
    fail("the object was changed or removed since it was opened; open the store anew");
  }
  if (reply.status == 200 && !is_whole)
    fail("the server does not answer requests for ranges of bytes");
  if (reply.status != 206 && !is_whole) fail("the server answers " + status_text(reply.status));
  const std::string& content = reply.header("content-range");
  const std::string expected =
      fmt::format("bytes {}-{}/{}", range.offset, range.end() - 1, state_.size);
  if (reply.status == 206 && content != expected && !content.ends_with("/*"))
    fail(fmt::format("the server sent '{}' in place of '{}'", content, expected));
  if (reply.body.size() != range.size)
    fail(fmt::format("the server sent {} bytes in place of {}", reply.body.size(), range.size));
  return std::move(reply.body);
}

}  // namespace isobrick
