#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include <isobrick/storage.h>
#include "bricks/storage/cached_object.h"
#include "io/http/http_client.h"

namespace isobrick::inline v0 {

class RemoteObject;

/// The bytes of remote objects that are fetched before they are read. Their number is bounded:
/// hints wait for room in their order. Thread-safe; owned by std::make_shared, because replies come
/// later.
class RangeFetcher : public std::enable_shared_from_this<RangeFetcher> {
 public:
  /// Keeps so many bytes at most.
  RangeFetcher(std::shared_ptr<HttpClient> client, std::uint64_t max_bytes)
      : client_(std::move(client)), max_bytes_(max_bytes) {}

  /// Fetches these bytes soon, close ranges of an object with one request.
  void hint(const std::shared_ptr<const RemoteObject>& object, ByteRange range);
  /// Keeps bytes that came with something else, while nothing else needs the room.
  void keep(const std::shared_ptr<const RemoteObject>& object, std::vector<std::byte> first_bytes);
  /// Fills `out` from what is kept or on its way, else with requests of its own.
  void read(const std::shared_ptr<const RemoteObject>& object, std::uint64_t offset,
            std::span<std::byte> out);
  /// Drops what is kept of an object that ends.
  void forget(const RemoteObject& object);

  HttpClient& client() { return *client_; }
  std::uint64_t max_bytes() const { return max_bytes_; }

 private:
  using Clock = std::chrono::steady_clock;
  enum class State { pending, sent, done, failed };
  struct Fetch {
    const RemoteObject* object;
    std::weak_ptr<const RemoteObject> owner;
    ByteRange range;
    State state = State::pending;
    bool is_spare = false;         ///< nobody asked for it
    bool is_cached = false;        ///< whether a thread has begun to keep it on the disk
    std::uint64_t unread = 0;      ///< bytes that were asked for and not read yet
    Clock::time_point done_at{};   ///< when it was done
    std::vector<std::byte> bytes;  ///< once it is done
  };
  using FetchPtr = std::shared_ptr<Fetch>;
  /// The fetches of one object by their first byte.
  using Ranges = std::map<std::uint64_t, FetchPtr>;

  FetchPtr find(const RemoteObject* object, std::uint64_t offset) const;
  bool make_room(std::uint64_t bytes);
  bool add(const FetchPtr& fetch);
  void remove(const FetchPtr& fetch);
  void schedule();
  std::vector<FetchPtr> take_pending();
  void send_pending();
  void send(const FetchPtr& fetch);
  std::size_t read_kept(const RemoteObject& object, std::uint64_t offset, std::span<std::byte> out);
  std::size_t read_now(const RemoteObject& object, std::uint64_t offset, std::span<std::byte> out);

  std::shared_ptr<HttpClient> client_;
  std::uint64_t max_bytes_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::map<const RemoteObject*, Ranges> objects_;
  std::deque<FetchPtr> pending_;  ///< in the order of their hints; some are no longer needed
  std::list<FetchPtr> kept_;      ///< sent or done, oldest first
  std::uint64_t bytes_ = 0;       ///< of those
  bool is_scheduled_ = false;     ///< whether pending fetches are looked at soon
};

/// An object that a URL names.
class RemoteObject final : public StoredObject, public std::enable_shared_from_this<RemoteObject> {
 public:
  /// `cached`: its bytes on the disk; null: none are kept there.
  RemoteObject(std::shared_ptr<RangeFetcher> fetcher, std::string name, std::string url,
               ObjectState state, std::unique_ptr<const CachedObject> cached)
      : fetcher_(std::move(fetcher)),
        name_(std::move(name)),
        url_(std::move(url)),
        state_(std::move(state)),
        cached_(std::move(cached)) {}
  ~RemoteObject() override { fetcher_->forget(*this); }

  std::string name() const override { return name_; }
  std::uint64_t size() const override { return state_.size; }
  void read(std::uint64_t offset, std::span<std::byte> bytes) const override;
  void will_need(std::uint64_t offset, std::uint64_t size) const override;

  /// The request of some of its bytes.
  HttpRequest request(ByteRange range) const;
  /// The bytes of a reply to it. Throws Error where it is another answer or another state.
  std::vector<std::byte> bytes_of(HttpReply reply, ByteRange range) const;

  const ObjectState& state() const { return state_; }
  /// Its bytes on the disk; null: none are kept there.
  const CachedObject* cached() const { return cached_.get(); }

 private:
  bool is_of_another_state(const HttpReply& reply) const;

  std::shared_ptr<RangeFetcher> fetcher_;
  std::string name_, url_;
  ObjectState state_;
  std::unique_ptr<const CachedObject> cached_;
};

}  // namespace isobrick
