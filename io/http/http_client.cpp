#include "io/http/http_client.h"

#include <fmt/format.h>

#include <future>
#include <utility>

#include <isobrick/error.h>
#include "io/bytes/module.h"

namespace isobrick::inline v0 {

const std::string& HttpReply::header(const std::string& name) const {
  static const std::string none;
  const auto found = headers.find(name);
  return found == headers.end() ? none : found->second;
}

HttpReply fetch(HttpClient& client, HttpRequest request) {
  // Shared: the promise may outlive the wait for its result.
  const auto promise = std::make_shared<std::promise<HttpReply>>();
  std::future<HttpReply> reply = promise->get_future();
  client.send(std::move(request), [promise](HttpReply got, const std::exception_ptr& error) {
    if (error)
      promise->set_exception(error);
    else
      promise->set_value(std::move(got));
  });
  return reply.get();
}

std::unique_ptr<HttpClient> make_http_client([[maybe_unused]] const HttpOptions& options) {
#ifdef ISOBRICK_WITH_CURL
  static const auto& module = load_module<CurlModule>("curl", "URLs");
  return module.make_client(options);
#else
  throw UsageError(
      "this isobrick cannot read from URLs: it was built without libcurl4-openssl-dev");
#endif
}

std::string status_text(int status) {
  constexpr std::pair<int, const char*> kReasons[]{{301, "Moved Permanently"},
                                                   {400, "Bad Request"},
                                                   {401, "Unauthorized"},
                                                   {403, "Forbidden"},
                                                   {404, "Not Found"},
                                                   {408, "Request Timeout"},
                                                   {409, "Conflict"},
                                                   {412, "Precondition Failed"},
                                                   {416, "Range Not Satisfiable"},
                                                   {429, "Too Many Requests"},
                                                   {500, "Internal Server Error"},
                                                   {502, "Bad Gateway"},
                                                   {503, "Service Unavailable"},
                                                   {504, "Gateway Timeout"}};
  for (const auto& [number, reason] : kReasons)
    if (number == status) return fmt::format("{} {}", status, reason);
  return std::to_string(status);
}

}  // namespace isobrick
