#pragma once

#include <algorithm>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "io/http/http_client.h"

namespace isobrick::test {

using Bytes = std::vector<std::byte>;

inline Bytes noise(std::size_t size) {
  Bytes bytes(size);
  std::uint32_t state = 7;
  for (std::byte& b : bytes)
    b = static_cast<std::byte>((state = state * 1664525 + 1013904223) >> 24);
  return bytes;
}

/// A server in memory, and a client of it.
class FakeClient final : public HttpClient {
 public:
  std::map<std::string, Bytes> objects;  ///< by URL
  std::string etag = "\"1\"";
  std::function<void(const HttpRequest&, HttpReply&)> change;  ///< of replies

  FakeClient() : thread_([this] { run(); }) {}
  ~FakeClient() override {
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }

  void send(HttpRequest request, Done done) override {
    post([this, request = std::move(request), done = std::move(done)] {
      ranges_.push_back(request.range.value_or(ByteRange{}));
      done(reply_to(request), nullptr);
    });
  }
  void call_after(std::chrono::milliseconds, std::function<void()> function) override {
    const std::lock_guard lock(mutex_);
    later_.push_back(std::move(function));
  }

  /// Does what is put off, and waits until nothing is left to do.
  void settle() {
    std::unique_lock lock(mutex_);
    while (!later_.empty() || !tasks_.empty() || is_busy_) {
      std::move(later_.begin(), later_.end(), std::back_inserter(tasks_));
      later_.clear();
      changed_.notify_all();
      changed_.wait(lock, [&] { return tasks_.empty() && !is_busy_; });
    }
  }
  /// The ranges of the requests since the last call.
  std::vector<ByteRange> take_ranges() {
    settle();
    const std::lock_guard lock(mutex_);
    return std::exchange(ranges_, {});
  }

 private:
  HttpReply reply_to(const HttpRequest& request) const {
    HttpReply reply;
    const auto found = objects.find(request.url);
    const auto has = [&](const std::string& header) {
      return std::ranges::find(request.headers, header) != request.headers.end();
    };
    if (found == objects.end()) {
      reply.status = 404;
    } else if (has("If-None-Match: " + etag)) {
      reply.status = 304;
    } else if (std::ranges::any_of(
                   request.headers,
                   [](const std::string& header) { return header.starts_with("If-Match: "); }) &&
               !has("If-Match: " + etag)) {
      reply.status = 412;
    } else if (request.range->offset >= found->second.size()) {
      reply.status = 416;
      reply.headers["content-range"] = fmt::format("bytes */{}", found->second.size());
    } else {
      const Bytes& all = found->second;
      const std::size_t begin = request.range->offset,
                        end = std::min<std::size_t>(request.range->end(), all.size());
      reply.status = 206;
      reply.headers["etag"] = etag;
      reply.headers["content-range"] = fmt::format("bytes {}-{}/{}", begin, end - 1, all.size());
      reply.body.assign(all.begin() + static_cast<std::ptrdiff_t>(begin),
                        all.begin() + static_cast<std::ptrdiff_t>(end));
    }
    if (change) change(request, reply);
    return reply;
  }

  void post(std::function<void()> task) {
    {
      const std::lock_guard lock(mutex_);
      tasks_.push_back(std::move(task));
    }
    changed_.notify_all();
  }
  void run() {
    std::unique_lock lock(mutex_);
    while (true) {
      changed_.wait(lock, [&] { return stop_ || !tasks_.empty(); });
      if (tasks_.empty()) return;
      const auto task = std::move(tasks_.front());
      tasks_.pop_front();
      is_busy_ = true;
      lock.unlock();
      task();
      lock.lock();
      is_busy_ = false;
      changed_.notify_all();
    }
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> tasks_, later_;
  std::vector<ByteRange> ranges_;
  bool stop_ = false, is_busy_ = false;
  std::thread thread_;
};

}  // namespace isobrick::test
