#include "bricks/storage/remote_storage.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <chrono>
#include <deque>
#include <future>
#include <mutex>
#include <unordered_map>
#include <utility>

#include <isobrick/error.h>
#include "bricks/storage/remote_object.h"
#include "bricks/storage/remote_url.h"
#include "bricks/storage/s3_xml.h"
#include "bricks/storage/storage_keys.h"
#include "core/text_hash.h"

namespace isobrick::inline v0 {
namespace {

/// Bytes that come with the size of an object: all of metadata and of small chunks.
constexpr std::uint64_t kHead = std::uint64_t{64} << 10;
/// Objects whose size and state are remembered.
constexpr std::size_t kMaxObjects = 10000;

/// The number after the "/" of "bytes 0-99/1234", or nullopt.
std::optional<std::uint64_t> total_size(const std::string& content_range) {
  const std::size_t slash = content_range.find('/');
  if (slash == content_range.npos) return std::nullopt;
  std::uint64_t size = 0;
  const char* const end = content_range.data() + content_range.size();
  const auto [at, error] = std::from_chars(content_range.data() + slash + 1, end, size);
  if (error != std::errc() || at != end) return std::nullopt;
  return size;
}

/// Without a word of the server, an object is not asked for again so soon.
constexpr std::int64_t kFreshSeconds = 600;

std::int64_t unix_seconds() {
  return std::chrono::duration_cast<std::chrono::seconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

/// For how long a reply may be taken for the present state; nullopt: it must not be kept.
std::optional<std::int64_t> seconds_fresh(const std::string& cache_control) {
  if (cache_control.find("no-store") != cache_control.npos) return std::nullopt;
  if (cache_control.find("no-cache") != cache_control.npos) return 0;
  constexpr std::string_view name = "max-age=";
  const std::size_t at = cache_control.find(name);
  std::uint32_t seconds = 0;
  if (at == cache_control.npos) return kFreshSeconds;
  const char* const begin = cache_control.data() + at + name.size();
  const auto parsed = std::from_chars(begin, cache_control.data() + cache_control.size(), seconds);
  return parsed.ec == std::errc() ? seconds : 0;
}

/// Lets the server answer 304 where the object is still in this state.
void ask_for_change(HttpRequest& request, const ObjectState& state) {
  if (!state.etag.empty())
    request.headers.push_back("If-None-Match: " + state.etag);
  else if (!state.last_modified.empty())
    request.headers.push_back("If-Modified-Since: " + state.last_modified);
}

/// Metadata of the root, which tell whether a store was written anew.
bool is_root_file(const std::string& key) {
  return std::ranges::find(kZarrFiles, key) != kZarrFiles.end();
}

class RemoteStorage final : public Storage, public std::enable_shared_from_this<RemoteStorage> {
 public:
  RemoteStorage(RemotePlace place, const RemoteOptions& options, std::shared_ptr<HttpClient> client)
      : place_(std::move(place)),
        client_(std::move(client)),
        fetcher_(std::make_shared<RangeFetcher>(client_, options.memory)) {
    if (!options.cache_folder.empty() && options.cache_limit > 0)
      cache_ =
          std::make_shared<RangeCache>(options.cache_folder, options.cache_limit, options.on_note);
  }

  std::string name() const override { return place_.name; }
  std::string name_of(const std::string& key) const override { return place_.name + '/' + key; }

  std::shared_ptr<const StoredObject> open(const std::string& key) const override {
    const Opened opened = begin_open(key);
    try {
      const auto object = opened.object.get();
      note_state(key, *opened.reply);
      return object;
    } catch (const Error&) {
      // The next call tries again.
      const std::lock_guard lock(mutex_);
      opened_.erase(key);
      throw;
    }
  }

  void will_open(const std::string& key) const override { begin_open(key); }
  bool is_remote() const override { return true; }
  std::uint64_t memory() const override { return fetcher_->max_bytes(); }

  std::vector<std::string> list(const std::string& folder) const override {
    if (place_.list_url.empty()) return {};
    const std::string prefix = place_.list_prefix + (folder.empty() ? "" : folder + '/');
    std::vector<std::string> names;
    std::string next;
    do {
      std::string url = place_.list_url + '?';
      // In the order of the alphabet, as the signature wants them.
      if (!next.empty()) url += "continuation-token=" + percent_encode(next, false) + '&';
      url += "delimiter=%2F&list-type=2&prefix=" + percent_encode(prefix, false);
      HttpReply reply = fetch(*client_, {.url = url});
      if (reply.status != 200)
        throw Error(
            fmt::format("cannot list '{}': {}", name_of(folder), status_text(reply.status)));
      S3Listing part = parse_s3_listing(
          {reinterpret_cast<const char*>(reply.body.data()), reply.body.size()}, prefix);
      std::move(part.names.begin(), part.names.end(), std::back_inserter(names));
      next = std::move(part.next);
    } while (!next.empty());
    return names;
  }

  /// Whether the server refused to show an object, which then seems to be missing.
  bool was_refused() const { return was_refused_; }

  /// The object of this key tells whether the store was written anew: as long as it does not, the
  /// cache need not ask for each object again.
  void set_root(const std::string& key) const {
    const Object object = cache_ ? begin_open(key).object.get() : nullptr;
    if (!object || !object->state().is_known()) return;
    const std::string url = url_of(key);
    root_ = text_hash(fmt::format("{}\n{}\n{}", url, object->state().hash(),
                                  cache_->last_change(cache_->folder_of(url))));
    const std::lock_guard lock(mutex_);
    root_url_ = url;
  }

 private:
  using Object = std::shared_ptr<const RemoteObject>;
  /// What a reply says of an object, until the cache has it.
  using Reply = std::optional<CachedState>;
  struct Opened {
    std::shared_future<Object> object;
    std::shared_ptr<Reply> reply;  ///< valid when the object is there
  };

  std::string url_of(const std::string& key) const {
    return place_.base + '/' + percent_encode(key, true) + place_.query;
  }

  Opened begin_open(const std::string& key) const {
    const auto promise = std::make_shared<std::promise<Object>>();
    const Opened opened{promise->get_future().share(), std::make_shared<Reply>()};
    {
      const std::lock_guard lock(mutex_);
      const auto [found, is_new] = opened_.try_emplace(key, opened);
      if (!is_new) return found->second;
      keys_.push_back(key);
      if (keys_.size() > kMaxObjects) {
        opened_.erase(keys_.front());
        keys_.pop_front();
      }
    }
    HttpRequest request{.url = url_of(key), .range = ByteRange{0, kHead}, .max_body = kHead};
    const Reply known = known_state(key);
    if (known && is_fresh(*known)) {
      promise->set_value(known->is_missing ? nullptr : make_object(key, known->state));
      return opened;
    }
    if (known) ask_for_change(request, known->state);
    client_->send(std::move(request), [weak = weak_from_this(), promise, key, known, opened](
                                          HttpReply reply, const std::exception_ptr& error) {
      const auto self = weak.lock();
      try {
        if (error) std::rethrow_exception(error);
        promise->set_value(self ? self->object_of(key, known, std::move(reply), *opened.reply)
                                : nullptr);
      } catch (const Error&) {
        promise->set_exception(std::current_exception());
      }
    });
    return opened;
  }

  /// What the cache knows of an object; nothing of files of the root, which are always read.
  Reply known_state(const std::string& key) const {
    if (!cache_ || is_root_file(key)) return std::nullopt;
    return cache_->find(cache_->folder_of(url_of(key)));
  }

  bool is_fresh(const CachedState& known) const {
    return root_ != 0 && known.root == root_ && known.fresh_until > unix_seconds();
  }

  /// Hands what a reply says to the cache, on the caller's thread: the client's goes on.
  void note_state(const std::string& key, Reply& reply) const {
    Reply taken;
    {
      const std::lock_guard lock(mutex_);
      taken = std::exchange(reply, std::nullopt);
    }
    if (taken && cache_ && !is_root_file(key)) cache_->put(cache_->folder_of(url_of(key)), *taken);
  }

  Object make_object(const std::string& key, const ObjectState& state,
                     bool may_be_kept = true) const {
    std::unique_ptr<const CachedObject> cached;
    if (cache_ && may_be_kept && state.is_known()) {
      const std::lock_guard lock(mutex_);
      cached = std::make_unique<const CachedObject>(cache_, url_of(key), state, root_url_);
    }
    return std::make_shared<const RemoteObject>(fetcher_, name_of(key), url_of(key), state,
                                                std::move(cached));
  }

  /// The object of a reply with its first bytes; null where there is none. `to_note`: what the
  /// cache is to know of it.
  Object object_of(const std::string& key, const Reply& known, HttpReply&& reply,
                   Reply& to_note) const {
    const std::string name = name_of(key);
    const int status = reply.status;
    const auto fresh_for = seconds_fresh(reply.header("cache-control"));
    CachedState now{.fresh_until = unix_seconds() + fresh_for.value_or(0), .root = root_};
    if (status == 403) was_refused_ = true;
    now.is_missing = status == 404 || status == 410;
    if (now.is_missing && fresh_for) to_note = now;
    if (status == 403 || now.is_missing) return nullptr;
    if (status == 304 && known && !known->is_missing) {
      now.state = known->state;
      if (fresh_for) to_note = now;
      return make_object(key, now.state);
    }
    if (status == 301 && !reply.header("x-amz-bucket-region").empty())
      throw Error(fmt::format("'{}' is in another region: set AWS_REGION={}", place_.name,
                              reply.header("x-amz-bucket-region")));
    std::optional<std::uint64_t> size;
    if (status == 200) size = reply.body.size();
    // No byte of an empty object can be requested.
    if (status == 206 || status == 416) size = total_size(reply.header("content-range"));
    if (status == 416 && size && *size > 0) size.reset();
    if (status != 200 && status != 206 && status != 416)
      throw Error(fmt::format("cannot read '{}': {}", name, status_text(status)));
    if (!size)
      throw Error(fmt::format("cannot read '{}': the server does not tell its size", name));
    now.state = {*size, reply.header("etag"), reply.header("last-modified")};
    auto object = make_object(key, now.state, fresh_for.has_value());
    if (fresh_for && now.state.is_known()) to_note = now;
    if (status == 416) reply.body.clear();
    fetcher_->keep(object, std::move(reply.body));
    return object;
  }

  RemotePlace place_;
  std::shared_ptr<HttpClient> client_;
  std::shared_ptr<RangeFetcher> fetcher_;
  std::shared_ptr<RangeCache> cache_;            ///< null: nothing is kept on the disk
  mutable std::atomic<std::uint64_t> root_ = 0;  ///< 0: not known
  mutable std::mutex mutex_;
  mutable std::string root_url_;  ///< "": not known
  mutable std::unordered_map<std::string, Opened> opened_;
  mutable std::deque<std::string> keys_;  ///< of `opened_`, oldest first
  mutable std::atomic<bool> was_refused_ = false;
};

/// A zip lies in a storage of its own folder, under its name.
std::pair<std::string, std::string> split_last(const std::string& url) {
  const std::size_t question = std::min(url.find('?'), url.size());
  const std::size_t slash = url.rfind('/', question);
  return {url.substr(0, slash) + url.substr(question), url.substr(slash + 1, question - slash - 1)};
}

HttpOptions http_options(const RemotePlace& place, const RemoteOptions& options) {
  return {options.max_requests, options.tries, options.timeout_seconds, options.cancel, place.s3};
}

}  // namespace

std::shared_ptr<const Storage> remote_storage(const std::string& url, const RemoteOptions& options,
                                              std::shared_ptr<HttpClient> client) {
  return std::make_shared<const RemoteStorage>(parse_remote_url(url, process_environment()),
                                               options, std::move(client));
}

namespace {

std::shared_ptr<const RemoteStorage> make_storage(const std::string& url,
                                                  const RemoteOptions& options) {
  if (!is_url(url)) throw UsageError(fmt::format("'{}' is no URL of http, https or s3", url));
  if (options.max_requests < 1 || options.tries < 1 || !(options.timeout_seconds > 0))
    throw UsageError("a remote storage needs a request, a try and a time at least");
  RemotePlace place = parse_remote_url(url, process_environment());
  std::shared_ptr<HttpClient> client = make_http_client(http_options(place, options));
  return std::make_shared<const RemoteStorage>(std::move(place), options, std::move(client));
}

}  // namespace

std::shared_ptr<const Storage> remote_storage(const std::string& url,
                                              const RemoteOptions& options) {
  return make_storage(url, options);
}

std::shared_ptr<const Storage> open_remote_storage(const std::string& url,
                                                   const RemoteOptions& options) {
  const auto [folder, name] = split_last(url);
  if (name.ends_with(".zip") || name.ends_with(".ozx")) {
    const auto object = make_storage(folder, options)->open(name);
    if (!object) throw Error(fmt::format("'{}' does not exist", url));
    return zip_storage(object);
  }
  const auto storage = make_storage(url, options);
  for (const char* key : kZarrFiles) storage->will_open(key);
  const auto is_there = [&](const char* key) { return storage->open(key) != nullptr; };
  if (const auto* const root = std::ranges::find_if(kZarrFiles, is_there);
      root != kZarrFiles.end()) {
    storage->set_root(*root);
    return storage;
  }
  if (storage->was_refused())
    throw Error(fmt::format(
        "cannot read '{}': the server refuses it (403 Forbidden), or there is no store; "
        "check the name and the credentials",
        storage->name()));
  throw Error(
      fmt::format("'{}' is no store: it has no zarr.json and no .zattrs; of URLs only stores "
                  "and zips of them are read",
                  storage->name()));
}

}  // namespace isobrick
