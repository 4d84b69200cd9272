#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "io/bytes/url.h"
#include "io/http/http_client.h"

namespace isobrick::inline v0 {

/// A value of the environment, or nullopt.
using Environment = std::function<std::optional<std::string>(const std::string& name)>;
/// That of the process. An empty value counts as none.
Environment process_environment();

/// Where the objects of a remote storage are.
struct RemotePlace {
  std::string name;                 ///< for messages: the URL without what follows "?"
  std::string base;                 ///< the URL of an object is base + "/" + encoded key + query
  std::string query;                ///< "?…" or ""
  std::optional<S3Credentials> s3;  ///< nullopt: requests are not signed
  std::string list_url;             ///< of S3: the bucket's URL; "": objects cannot be listed
  std::string list_prefix;          ///< of S3: what the keys of the bucket begin with, not encoded
};

/// Understands a URL. That of s3://BUCKET/PATH is one of Amazon's, or of AWS_ENDPOINT_URL_S3 or
/// AWS_ENDPOINT_URL. Credentials are those of AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and
/// AWS_SESSION_TOKEN, else of the profile AWS_PROFILE in ~/.aws/credentials; without any, or with
/// AWS_NO_SIGN_REQUEST, requests are anonymous. The region is AWS_REGION, AWS_DEFAULT_REGION, that
/// of the profile in ~/.aws/config, or us-east-1. Throws UsageError for a URL that makes no sense.
RemotePlace parse_remote_url(const std::string& url, const Environment& environment);

/// Percent-encodes all but letters, digits and "-._~", and "/" where `keep_slash`.
std::string percent_encode(std::string_view text, bool keep_slash);

}  // namespace isobrick
