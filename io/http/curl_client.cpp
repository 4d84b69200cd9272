#include "io/http/curl_client.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <random>
#include <string_view>
#include <utility>

#include <isobrick/error.h>
#include "io/http/curl_authorities.h"

namespace isobrick::inline v0 {
namespace {

using namespace std::chrono_literals;

constexpr auto kFirstPause = 250ms;
constexpr auto kMaxPause = 10s;
/// Seconds that a server may ask for.
constexpr int kMaxRetryAfter = 60;
/// Of each request, before any server has replied.
constexpr int kFirstTries = 3;
/// Bytes of the reply to a failed request that are kept, for the message.
constexpr std::size_t kMaxErrorBody = std::size_t{16} << 10;

bool is_temporary(int status) {
  return status == 408 || status == 429 || status == 500 || (status >= 502 && status <= 504);
}

bool is_temporary(CURLcode code) {
  switch (code) {
    case CURLE_COULDNT_CONNECT:
    case CURLE_COULDNT_RESOLVE_HOST:
    case CURLE_GOT_NOTHING:
    case CURLE_HTTP2:
    case CURLE_HTTP2_STREAM:
    case CURLE_OPERATION_TIMEDOUT:
    case CURLE_PARTIAL_FILE:
    case CURLE_RECV_ERROR:
    case CURLE_SEND_ERROR:
    case CURLE_SSL_CONNECT_ERROR: return true;
    default: return false;
  }
}

/// The text between <Code> and <Message> of S3's description of an error, or "".
std::string s3_problem(const std::vector<std::byte>& body) {
  const std::string_view text(reinterpret_cast<const char*>(body.data()), body.size());
  std::string problem;
  for (const auto& [open, close] :
       {std::pair("<Code>", "</Code>"), std::pair("<Message>", "</Message>")}) {
    const std::size_t begin = text.find(open), end = text.find(close);
    if (begin == text.npos || end == text.npos || end < begin) continue;
    const std::size_t from = begin + std::string_view(open).size();
    problem += (problem.empty() ? "" : ": ") + std::string(text.substr(from, end - from));
  }
  return problem;
}

/// The number that a text is, or nullopt.
std::optional<int> number_in(std::string_view text) {
  int number = 0;
  const auto [at, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || at != text.data() + text.size()) return std::nullopt;
  return number;
}

std::chrono::milliseconds random_part(std::chrono::milliseconds pause) {
  thread_local std::minstd_rand generator{std::random_device{}()};
  std::uniform_real_distribution<double> part(0.5, 1);
  return std::chrono::milliseconds(
      std::lround(static_cast<double>(pause.count()) * part(generator)));
}

}  // namespace

struct CurlLoop::Transfer {
  HttpRequest request;
  Done done;
  int tries = 0;
  CURL* easy = nullptr;
  curl_slist* headers = nullptr;
  HttpReply reply;
  std::string problem;  ///< why a callback ended the transfer
  std::size_t sent = 0;
  char error[CURL_ERROR_SIZE] = {};

  Transfer(HttpRequest&& wanted, Done&& callback)
      : request(std::move(wanted)), done(std::move(callback)) {}
  Transfer(const Transfer&) = delete;
  Transfer& operator=(const Transfer&) = delete;
  ~Transfer() { clear(); }

  void clear() {
    if (easy != nullptr) curl_easy_cleanup(easy);
    curl_slist_free_all(headers);
    easy = nullptr;
    headers = nullptr;
    reply = {};
    problem.clear();
    sent = 0;
    error[0] = '\0';
  }

  static std::size_t on_body(char* data, std::size_t one, std::size_t count, void* self) {
    auto& t = *static_cast<Transfer*>(self);
    const std::size_t size = one * count;
    auto& body = t.reply.body;
    if (t.reply.status >= 300) {  // a description of what failed
      const std::size_t kept = std::min(size, kMaxErrorBody - std::min(kMaxErrorBody, body.size()));
      const auto* bytes = reinterpret_cast<const std::byte*>(data);
      body.insert(body.end(), bytes, bytes + kept);
      return size;
    }
    if (size > t.request.max_body - body.size()) {
      t.problem = t.request.range
                      ? "the server does not answer requests for ranges of bytes"
                      : fmt::format("the reply has more than {} bytes", t.request.max_body);
      return 0;
    }
    const auto* bytes = reinterpret_cast<const std::byte*>(data);
    body.insert(body.end(), bytes, bytes + size);
    return size;
  }

  static std::size_t on_header(char* data, std::size_t one, std::size_t count, void* self) {
    auto& t = *static_cast<Transfer*>(self);
    const std::string_view line(data, one * count);
    if (line.starts_with("HTTP/")) {  // also of each redirection
      t.reply = {};
      const std::size_t space = line.find(' ');
      if (space != line.npos) t.reply.status = number_in(line.substr(space + 1, 3)).value_or(0);
      if (t.request.range && t.reply.status < 300)
        t.reply.body.reserve(static_cast<std::size_t>(t.request.range->size));
      return line.size();
    }
    const std::size_t colon = line.find(':');
    if (colon == line.npos) return line.size();
    std::string name(line.substr(0, colon));
    std::transform(name.begin(), name.end(), name.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    std::string_view value = line.substr(colon + 1);
    const auto is_space = [](char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; };
    while (!value.empty() && is_space(value.front())) value.remove_prefix(1);
    while (!value.empty() && is_space(value.back())) value.remove_suffix(1);
    t.reply.headers[name] = value;
    return line.size();
  }

  static std::size_t on_upload(char* out, std::size_t one, std::size_t count, void* self) {
    auto& t = *static_cast<Transfer*>(self);
    const std::size_t size = std::min(one * count, t.request.body.size() - t.sent);
    std::copy_n(t.request.body.begin() + static_cast<std::ptrdiff_t>(t.sent), size,
                reinterpret_cast<std::byte*>(out));
    t.sent += size;
    return size;
  }

  static int on_seek(void* self, curl_off_t offset, int origin) {
    auto& t = *static_cast<Transfer*>(self);
    if (origin != SEEK_SET || offset < 0 ||
        static_cast<std::size_t>(offset) > t.request.body.size())
      return CURL_SEEKFUNC_FAIL;
    t.sent = static_cast<std::size_t>(offset);
    return CURL_SEEKFUNC_OK;
  }
};

CurlLoop::CurlLoop(const HttpOptions& options) : options_(options) {
  static const CURLcode initialised = curl_global_init(CURL_GLOBAL_DEFAULT);
  multi_ = curl_multi_init();
  if (initialised != CURLE_OK || multi_ == nullptr) throw Error("libcurl cannot be initialised");
  const long requests = options_.max_requests;
  curl_multi_setopt(multi_, CURLMOPT_MAX_HOST_CONNECTIONS, requests);
  curl_multi_setopt(multi_, CURLMOPT_MAXCONNECTS, requests);
  on_cancel_.emplace(options_.cancel, [this] { curl_multi_wakeup(multi_); });
}

CurlLoop::~CurlLoop() {
  on_cancel_.reset();
  curl_multi_cleanup(multi_);
}

CurlClient::~CurlClient() {
  loop_->stop();
  // A reply may end what owns the client.
  if (thread_.get_id() == std::this_thread::get_id())
    thread_.detach();
  else
    thread_.join();
}

void CurlLoop::stop() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  curl_multi_wakeup(multi_);
}

void CurlLoop::send(HttpRequest request, Done done) {
  auto transfer = std::make_unique<Transfer>(std::move(request), std::move(done));
  {
    const std::lock_guard lock(mutex_);
    incoming_.push_back(std::move(transfer));
  }
  curl_multi_wakeup(multi_);
}

void CurlLoop::call_after(std::chrono::milliseconds pause, std::function<void()> function) {
  {
    const std::lock_guard lock(mutex_);
    incoming_timers_.emplace(Clock::now() + pause, std::move(function));
  }
  curl_multi_wakeup(multi_);
}

void CurlLoop::run() {
  while (take_incoming()) {
    if (options_.cancel.stop_requested()) {
      fail_all();
    } else {
      run_timers();
      start_waiting();
    }
    int running = 0;
    curl_multi_perform(multi_, &running);
    int left = 0;
    while (const CURLMsg* message = curl_multi_info_read(multi_, &left))
      if (message->msg == CURLMSG_DONE) finish(message->easy_handle, message->data.result);
    curl_multi_poll(multi_, nullptr, 0, poll_timeout(), nullptr);
  }
  fail_all();
}

/// Whether the client goes on.
bool CurlLoop::take_incoming() {
  const std::lock_guard lock(mutex_);
  std::move(incoming_.begin(), incoming_.end(), std::back_inserter(waiting_));
  incoming_.clear();
  timers_.merge(incoming_timers_);
  return !stop_;
}

void CurlLoop::run_timers() {
  while (!timers_.empty() && timers_.begin()->first <= Clock::now()) {
    const auto function = std::move(timers_.begin()->second);
    timers_.erase(timers_.begin());
    function();
  }
}

/// Milliseconds until there is something to do that nobody announces.
int CurlLoop::poll_timeout() const {
  using std::chrono::ceil;
  using std::chrono::milliseconds;
  if (timers_.empty()) return 1000;
  const auto left = ceil<milliseconds>(timers_.begin()->first - Clock::now());
  return static_cast<int>(std::clamp(left, milliseconds(0), milliseconds(1000)).count());
}

void CurlLoop::start_waiting() {
  const auto most = static_cast<std::size_t>(options_.max_requests);
  while (!waiting_.empty() && active_.size() < most) {
    Owned transfer = std::move(waiting_.front());
    waiting_.pop_front();
    start(std::move(transfer));
  }
}

void CurlLoop::start(Owned transfer) {
  transfer->clear();
  transfer->easy = curl_easy_init();
  if (transfer->easy == nullptr) {
    const auto error = std::make_exception_ptr(Error("libcurl cannot begin a request"));
    return transfer->done({}, error);
  }
  ++transfer->tries;
  set_options(*transfer);
  CURL* const easy = transfer->easy;
  active_.emplace(easy, std::move(transfer));
  curl_multi_add_handle(multi_, easy);
}

void CurlLoop::set_options(Transfer& t) const {
  CURL* const easy = t.easy;
  const HttpRequest& request = t.request;
  const auto set = [easy](CURLoption option, auto value) { curl_easy_setopt(easy, option, value); };
  set(CURLOPT_URL, request.url.c_str());
  set(CURLOPT_NOSIGNAL, 1L);
  set(CURLOPT_USERAGENT, "isobrick/" ISOBRICK_VERSION);
  set(CURLOPT_ERRORBUFFER, t.error);
  set(CURLOPT_HTTP_VERSION, static_cast<long>(CURL_HTTP_VERSION_2TLS));
  set(CURLOPT_PIPEWAIT, 1L);
  set_authorities(easy, options_.s3.has_value());
  set(CURLOPT_BUFFERSIZE, 512L << 10);
  set(CURLOPT_PROTOCOLS_STR, "http,https");
  set(CURLOPT_REDIR_PROTOCOLS_STR, "http,https");
  set(CURLOPT_FOLLOWLOCATION, options_.s3 ? 0L : 1L);
  set(CURLOPT_MAXREDIRS, 5L);
  set(CURLOPT_PATH_AS_IS, 1L);
  // A server that sends less than a byte a second is dead.
  const long timeout = std::max(1L, std::lround(options_.timeout_seconds));
  set(CURLOPT_CONNECTTIMEOUT, timeout);
  set(CURLOPT_LOW_SPEED_LIMIT, 1L);
  set(CURLOPT_LOW_SPEED_TIME, timeout);
  set(CURLOPT_WRITEFUNCTION, &Transfer::on_body);
  set(CURLOPT_WRITEDATA, &t);
  set(CURLOPT_HEADERFUNCTION, &Transfer::on_header);
  set(CURLOPT_HEADERDATA, &t);
  std::vector<std::string> headers = request.headers;
  if (request.range) {
    const ByteRange& r = *request.range;
    headers.push_back(fmt::format("Range: bytes={}-{}", r.offset, r.end() - 1));
  }
  if (request.method != "GET") {
    set(CURLOPT_CUSTOMREQUEST, request.method.c_str());
    if (request.method != "DELETE") {
      set(CURLOPT_UPLOAD, 1L);
      set(CURLOPT_INFILESIZE_LARGE, static_cast<curl_off_t>(request.body.size()));
      set(CURLOPT_READFUNCTION, &Transfer::on_upload);
      set(CURLOPT_READDATA, &t);
      set(CURLOPT_SEEKFUNCTION, &Transfer::on_seek);
      set(CURLOPT_SEEKDATA, &t);
      // libcurl would sign a header that is left out so; then a server that never replies to it
      // must not be waited for.
      if (!options_.s3) headers.emplace_back("Expect:");
      set(CURLOPT_EXPECT_100_TIMEOUT_MS, 100L);
    }
  }
  if (const auto& s3 = options_.s3) {
    set(CURLOPT_AWS_SIGV4, fmt::format("aws:amz:{}:s3", s3->region).c_str());
    set(CURLOPT_USERNAME, s3->access_key.c_str());
    set(CURLOPT_PASSWORD, s3->secret_key.c_str());
    // The transport protects the bytes; to hash them first would take another pass.
    headers.emplace_back("x-amz-content-sha256: UNSIGNED-PAYLOAD");
    if (!s3->session_token.empty()) headers.push_back("x-amz-security-token: " + s3->session_token);
  }
  for (const std::string& header : headers)
    t.headers = curl_slist_append(t.headers, header.c_str());
  set(CURLOPT_HTTPHEADER, t.headers);
}

void CurlLoop::finish(CURL* easy, CURLcode code) {
  const auto found = active_.find(easy);
  Owned transfer = std::move(found->second);
  active_.erase(found);
  curl_multi_remove_handle(multi_, easy);
  Transfer& t = *transfer;
  const int status = t.reply.status;
  if (code == CURLE_OK && !is_temporary(status)) return t.done(std::move(t.reply), nullptr);
  std::string why = t.problem;
  if (why.empty() && code != CURLE_OK)
    why = t.error[0] != '\0' ? t.error : curl_easy_strerror(code);
  if (code == CURLE_OK) {
    why = status_text(status);
    if (const std::string more = s3_problem(t.reply.body); !more.empty()) why += " (" + more + ")";
  }
  is_reachable_ |= status != 0;
  // A name that is wrong, and a machine without a network, are no failures for a while.
  const int tries = is_reachable_ ? options_.tries : std::min(options_.tries, kFirstTries);
  const bool can_help = code == CURLE_OK || is_temporary(code);
  if (can_help && t.tries < tries) return try_again(std::move(transfer));
  const std::string count = t.tries > 1 ? fmt::format(" ({} tries)", t.tries) : "";
  const auto error = std::make_exception_ptr(
      Error(fmt::format("cannot {} '{}': {}{}", t.request.method == "GET" ? "read" : "write",
                        t.request.url, why, count)));
  t.done({}, error);
}

/// After a pause that doubles, or the one that the server asks for.
void CurlLoop::try_again(Owned transfer) {
  std::chrono::milliseconds pause = kFirstPause * (1 << std::min(transfer->tries - 1, 16));
  pause = random_part(std::min<std::chrono::milliseconds>(pause, kMaxPause));
  if (const auto seconds = number_in(transfer->reply.header("retry-after")))
    pause = std::max<std::chrono::milliseconds>(
        pause, std::chrono::seconds(std::clamp(*seconds, 0, kMaxRetryAfter)));
  transfer->clear();
  // A std::function must be copyable.
  const auto held = std::make_shared<Owned>(std::move(transfer));
  timers_.emplace(Clock::now() + pause, [this, held] { waiting_.push_back(std::move(*held)); });
}

void CurlLoop::fail_all() {
  // A timer may hold a request that is tried again.
  for (auto timers = std::exchange(timers_, {}); const auto& [at, function] : timers) function();
  std::deque<Owned> ended = std::exchange(waiting_, {});
  for (auto& [easy, transfer] : active_) {
    curl_multi_remove_handle(multi_, easy);
    ended.push_back(std::move(transfer));
  }
  active_.clear();
  for (const Owned& transfer : ended)
    transfer->done({}, std::make_exception_ptr(Cancelled("reading was cancelled")));
}

}  // namespace isobrick
