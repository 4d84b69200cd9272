#pragma once

#include <curl/curl.h>

namespace isobrick::inline v0 {

/// Whom a transfer trusts besides the system: CURL_CA_BUNDLE, or else SSL_CERT_FILE and
/// SSL_CERT_DIR, as for the program curl; for S3 AWS_CA_BUNDLE goes first. libcurl itself looks at
/// no variable.
void set_authorities(CURL* easy, bool is_s3);

}  // namespace isobrick
