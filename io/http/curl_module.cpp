#include "io/http/curl_client.h"

namespace {

std::unique_ptr<isobrick::HttpClient> make_client(const isobrick::HttpOptions& options) {
  return std::make_unique<isobrick::CurlClient>(options);
}

}  // namespace

extern "C" __attribute__((visibility("default"))) const isobrick::CurlModule* isobrick_module() {
  static constexpr isobrick::CurlModule module{ISOBRICK_VERSION, make_client};
  return &module;
}
