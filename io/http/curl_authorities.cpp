#include "io/http/curl_authorities.h"

#include <cstdlib>

namespace isobrick::inline v0 {

void set_authorities(CURL* easy, bool is_s3) {
  const auto variable = [](const char* name) -> const char* {
    const char* value = std::getenv(name);
    return value != nullptr && *value != '\0' ? value : nullptr;
  };
  const char* bundle = is_s3 ? variable("AWS_CA_BUNDLE") : nullptr;
  if (bundle == nullptr) bundle = variable("CURL_CA_BUNDLE");
  if (bundle == nullptr) {
    if (const char* folder = variable("SSL_CERT_DIR"))
      curl_easy_setopt(easy, CURLOPT_CAPATH, folder);
    bundle = variable("SSL_CERT_FILE");
  }
  if (bundle != nullptr) curl_easy_setopt(easy, CURLOPT_CAINFO, bundle);
}

}  // namespace isobrick
