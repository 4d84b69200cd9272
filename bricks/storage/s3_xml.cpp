#include "bricks/storage/s3_xml.h"

#include <fmt/format.h>

#include <utility>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

std::string xml_decoded(std::string text) {
  for (const auto& [entity, character] :
       {std::pair("&lt;", "<"), std::pair("&gt;", ">"), std::pair("&quot;", "\""),
        std::pair("&apos;", "'"), std::pair("&amp;", "&")})
    for (std::size_t at = 0; (at = text.find(entity, at)) != text.npos; ++at)
      text.replace(at, std::string_view(entity).size(), character);
  return text;
}

}  // namespace

std::optional<std::string> next_element(const std::string& xml, std::string_view name,
                                        std::size_t& at) {
  const std::string open = fmt::format("<{}>", name), close = fmt::format("</{}>", name);
  const std::size_t begin = xml.find(open, at);
  if (begin == xml.npos) return std::nullopt;
  const std::size_t end = xml.find(close, begin);
  if (end == xml.npos) return std::nullopt;
  at = end + close.size();
  return xml.substr(begin + open.size(), end - begin - open.size());
}

S3Listing parse_s3_listing(const std::string& xml, const std::string& prefix) {
  if (xml.find("<ListBucketResult") == xml.npos)
    throw Error("the server's list of objects is no ListBucketResult");
  S3Listing listing;
  for (const char* outer : {"Contents", "CommonPrefixes"})
    for (std::size_t at = 0; const auto element = next_element(xml, outer, at);) {
      std::size_t inner = 0;
      auto key = next_element(*element, *outer == 'C' && outer[2] == 'n' ? "Key" : "Prefix", inner);
      if (key) key = xml_decoded(std::move(*key));
      if (!key || !key->starts_with(prefix)) continue;
      key->erase(0, prefix.size());
      while (key->ends_with('/')) key->pop_back();
      if (!key->empty()) listing.names.push_back(std::move(*key));
    }
  std::size_t at = 0;
  if (next_element(xml, "IsTruncated", at) == "true")
    listing.next = xml_decoded(next_element(xml, "NextContinuationToken", at = 0).value_or(""));
  return listing;
}

}  // namespace isobrick
