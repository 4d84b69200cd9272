#include "bricks/storage/remote_url.h"

#include <fmt/format.h>

#include <cstdlib>
#include <fstream>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

bool is_unreserved(char c) {
  return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-' ||
         c == '.' || c == '_' || c == '~';
}

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t\r");
  if (begin == text.npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t\r") + 1 - begin);
}

/// A value of a section of a file such as ~/.aws/credentials.
std::optional<std::string> ini_value(const std::string& path, const std::string& section,
                                     std::string_view key) {
  std::ifstream file(path);
  std::string line;
  bool is_inside = false;
  while (std::getline(file, line)) {
    const std::string_view text = trimmed(line);
    if (text.starts_with('[')) {
      is_inside = trimmed(text.substr(1, text.find(']') - 1)) == section;
    } else if (const std::size_t equals = text.find('='); is_inside && equals != text.npos) {
      if (trimmed(text.substr(0, equals)) == key)
        return std::string(trimmed(text.substr(equals + 1)));
    }
  }
  return std::nullopt;
}

/// The files and variables of Amazon's tools.
class AwsSettings {
 public:
  explicit AwsSettings(const Environment& environment) : environment_(environment) {
    const std::string home = environment("HOME").value_or("") + "/.aws/";
    credentials_ = environment("AWS_SHARED_CREDENTIALS_FILE").value_or(home + "credentials");
    config_ = environment("AWS_CONFIG_FILE").value_or(home + "config");
    profile_ = environment("AWS_PROFILE").value_or("default");
  }

  std::string region() const {
    for (const char* name : {"AWS_REGION", "AWS_DEFAULT_REGION"})
      if (const auto region = environment_(name)) return *region;
    return of_config("region").value_or("us-east-1");
  }

  std::optional<std::string> endpoint() const {
    for (const char* name : {"AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL"})
      if (const auto url = environment_(name)) return url;
    return of_config("endpoint_url");
  }

  std::optional<S3Credentials> credentials() const {
    if (const auto none = environment_("AWS_NO_SIGN_REQUEST"); none && *none != "NO")
      return std::nullopt;
    S3Credentials found{.region = region()};
    const auto access = environment_("AWS_ACCESS_KEY_ID"),
               secret = environment_("AWS_SECRET_ACCESS_KEY");
    if (access && secret) {
      found.access_key = *access;
      found.secret_key = *secret;
      found.session_token = environment_("AWS_SESSION_TOKEN").value_or("");
      return found;
    }
    const auto of_file = [&](const char* key) { return ini_value(credentials_, profile_, key); };
    const auto file_access = of_file("aws_access_key_id"),
               file_secret = of_file("aws_secret_access_key");
    if (!file_access || !file_secret) return std::nullopt;
    found.access_key = *file_access;
    found.secret_key = *file_secret;
    found.session_token = of_file("aws_session_token").value_or("");
    return found;
  }

 private:
  std::optional<std::string> of_config(const char* key) const {
    return ini_value(config_, profile_ == "default" ? profile_ : "profile " + profile_, key);
  }

  const Environment& environment_;
  std::string credentials_, config_, profile_;
};

/// Characters that no URL may have are encoded; "%" is left, because a URL is encoded already.
std::string cleaned(std::string_view text) {
  std::string clean;
  for (const char c : text)
    if (static_cast<unsigned char>(c) <= ' ' || static_cast<unsigned char>(c) >= 0x7f)
      clean += fmt::format("%{:02X}", static_cast<unsigned char>(c));
    else
      clean += c;
  return clean;
}

std::string without_end_slashes(std::string text) {
  while (text.ends_with('/')) text.pop_back();
  return text;
}

RemotePlace s3_place(const std::string& url, const Environment& environment) {
  const std::string_view rest = std::string_view(url).substr(5);
  const std::size_t slash = std::min(rest.find('/'), rest.size());
  const std::string bucket(rest.substr(0, slash));
  const std::string path =
      without_end_slashes(std::string(rest.substr(std::min(slash + 1, rest.size()))));
  if (bucket.empty()) throw UsageError(fmt::format("'{}' names no bucket: s3://BUCKET/PATH", url));
  const AwsSettings settings(environment);
  RemotePlace place{.name = without_end_slashes(url), .s3 = settings.credentials()};
  if (const auto endpoint = settings.endpoint())
    place.list_url = without_end_slashes(*endpoint) + '/' + percent_encode(bucket, false);
  else if (bucket.find('.') != bucket.npos)  // which no certificate of *.s3 fits
    place.list_url = fmt::format("https://s3.{}.amazonaws.com/{}", settings.region(), bucket);
  else
    place.list_url = fmt::format("https://{}.s3.{}.amazonaws.com", bucket, settings.region());
  place.base = path.empty() ? place.list_url : place.list_url + '/' + percent_encode(path, true);
  place.list_prefix = path.empty() ? "" : path + '/';
  return place;
}

}  // namespace

Environment process_environment() {
  return [](const std::string& name) -> std::optional<std::string> {
    const char* value = std::getenv(name.c_str());
    if (value == nullptr || *value == '\0') return std::nullopt;
    return value;
  };
}

std::string percent_encode(std::string_view text, bool keep_slash) {
  std::string encoded;
  for (const char c : text)
    if (is_unreserved(c) || (c == '/' && keep_slash))
      encoded += c;
    else
      encoded += fmt::format("%{:02X}", static_cast<unsigned char>(c));
  return encoded;
}

RemotePlace parse_remote_url(const std::string& url, const Environment& environment) {
  if (url.starts_with("s3://")) return s3_place(url, environment);
  const std::size_t hash = std::min(url.find('#'), url.size()),
                    question = std::min(url.find('?'), hash);
  RemotePlace place;
  if (question <= url.find("//") + 2) throw UsageError(fmt::format("'{}' names no host", url));
  place.base = without_end_slashes(cleaned(url.substr(0, question)));
  place.query = cleaned(url.substr(question, hash - question));
  // A password is nobody's business.
  const std::size_t host = place.base.find("//") + 2, at = place.base.find('@', host);
  place.name = place.base;
  if (at < place.base.find('/', host)) place.name.erase(host, at + 1 - host);
  return place;
}

}  // namespace isobrick
