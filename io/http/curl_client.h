#pragma once

#include <curl/curl.h>

#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <thread>
#include <unordered_map>
#include <utility>

#include "io/http/http_client.h"

namespace isobrick::inline v0 {

/// The requests of a CurlClient, by libcurl's multi interface.
class CurlLoop {
 public:
  using Done = HttpClient::Done;

  explicit CurlLoop(const HttpOptions& options);
  ~CurlLoop();
  CurlLoop(const CurlLoop&) = delete;
  CurlLoop& operator=(const CurlLoop&) = delete;

  void send(HttpRequest request, Done done);
  void call_after(std::chrono::milliseconds pause, std::function<void()> function);
  /// Works until stop().
  void run();
  /// Ends run() and all requests.
  void stop();

 private:
  using Clock = std::chrono::steady_clock;
  struct Transfer;
  using Owned = std::unique_ptr<Transfer>;

  bool take_incoming();
  void start_waiting();
  void start(Owned transfer);
  void set_options(Transfer& transfer) const;
  void finish(CURL* easy, CURLcode code);
  void try_again(Owned transfer);
  void run_timers();
  int poll_timeout() const;
  void fail_all();

  HttpOptions options_;
  CURLM* multi_ = nullptr;
  // Of the client's thread.
  std::deque<Owned> waiting_;
  std::unordered_map<CURL*, Owned> active_;
  std::multimap<Clock::time_point, std::function<void()>> timers_;
  bool is_reachable_ = false;  ///< whether any server has replied
  // Of all threads.
  std::mutex mutex_;
  std::deque<Owned> incoming_;
  std::multimap<Clock::time_point, std::function<void()>> incoming_timers_;
  bool stop_ = false;
  std::optional<std::stop_callback<std::function<void()>>> on_cancel_;
};

/// An HttpClient of libcurl.
class CurlClient final : public HttpClient {
 public:
  explicit CurlClient(const HttpOptions& options)
      : loop_(std::make_shared<CurlLoop>(options)), thread_([loop = loop_] { loop->run(); }) {}
  ~CurlClient() override;

  void send(HttpRequest request, Done done) override {
    loop_->send(std::move(request), std::move(done));
  }
  void call_after(std::chrono::milliseconds pause, std::function<void()> function) override {
    loop_->call_after(pause, std::move(function));
  }

 private:
  std::shared_ptr<CurlLoop> loop_;  ///< shared with its thread
  std::thread thread_;
};

}  // namespace isobrick
