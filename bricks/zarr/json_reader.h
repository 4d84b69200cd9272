#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// Metadata of others and of broken disks: every access reports where and what is
/// wrong instead of trusting that a member is there and of the right type.
class JsonReader {
 public:
  using Json = nlohmann::json;

  /// A value and how messages call it ("'scan.zarr/0/zarr.json': codecs[0]").
  JsonReader(const Json& value, std::string where) : value_(&value), where_(std::move(where)) {}

  const std::string& where() const { return where_; }
  [[noreturn]] void damaged(const std::string& what) const;      ///< throws DamageError
  [[noreturn]] void unsupported(const std::string& what) const;  ///< throws Error

  bool has(const char* key) const { return value_->is_object() && value_->contains(key); }
  JsonReader at(const char* key) const;  ///< a member that must be there
  JsonReader at(std::size_t i) const;    ///< an element that must be there
  std::size_t array_size() const;        ///< of what must be an array
  const Json& raw() const { return *value_; }

  std::string string() const;
  std::string string_at(const char* key) const { return at(key).string(); }
  bool boolean() const;
  double number() const;
  Index integer() const;
  /// An integer in [1, 2⁶²].
  Index positive() const;
  /// Throws Error unless this version of `what` is `known`; `renewal` is what to do about an
  /// older one.
  void check_version(const char* what, Index known, const char* renewal) const;

 private:
  const Json* value_;
  std::string where_;
};

/// Parses text, at most 64 levels deep. Throws DamageError naming `where`.
nlohmann::json parse_json(std::string_view text, const std::string& where);

/// No metadata file that makes sense is larger.
inline constexpr std::uint64_t kMaxMetadataBytes = std::uint64_t{4} << 20;

}  // namespace isobrick
