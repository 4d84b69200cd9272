#include "bricks/zarr/json_reader.h"

#include <fmt/format.h>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

// The parser itself does not recurse, but what it builds is walked recursively
// elsewhere, and each level costs far more memory than its byte of text.
constexpr int kMaxDepth = 64;

bool too_deep(std::string_view text) {
  int depth = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\')
        ++i;
      else if (c == '"')
        in_string = false;
    } else if (c == '"') {
      in_string = true;
    } else if (c == '{' || c == '[') {
      if (++depth > kMaxDepth) return true;
    } else if (c == '}' || c == ']') {
      --depth;
    }
  }
  return false;
}

}  // namespace

nlohmann::json parse_json(std::string_view text, const std::string& where) {
  if (text.size() > kMaxMetadataBytes)
    throw DamageError(fmt::format("{}: {} bytes are too many for metadata", where, text.size()));
  if (too_deep(text)) throw DamageError(fmt::format("{}: nested too deeply", where));
  try {
    return nlohmann::json::parse(text);
  } catch (const nlohmann::json::exception& e) {
    throw DamageError(fmt::format("{}: not valid JSON: {}", where, e.what()));
  }
}

void JsonReader::damaged(const std::string& what) const {
  throw DamageError(fmt::format("{}: {}", where_, what));
}

void JsonReader::unsupported(const std::string& what) const {
  throw Error(fmt::format("{}: {}", where_, what));
}

JsonReader JsonReader::at(const char* key) const {
  if (!value_->is_object()) damaged("must be an object");
  const auto found = value_->find(key);
  if (found == value_->end()) damaged(fmt::format("has no '{}'", key));
  return {*found, fmt::format("{}{}{}", where_, where_.ends_with('\'') ? ": " : ".", key)};
}

JsonReader JsonReader::at(std::size_t i) const {
  if (i >= array_size()) damaged(fmt::format("has no element {}", i));
  return {(*value_)[i], fmt::format("{}[{}]", where_, i)};
}

std::size_t JsonReader::array_size() const {
  if (!value_->is_array()) damaged("must be an array");
  return value_->size();
}

std::string JsonReader::string() const {
  if (!value_->is_string()) damaged("must be a string");
  return value_->get<std::string>();
}

bool JsonReader::boolean() const {
  if (!value_->is_boolean()) damaged("must be true or false");
  return value_->get<bool>();
}

double JsonReader::number() const {
  if (!value_->is_number()) damaged("must be a number");
  return value_->get<double>();
}

Index JsonReader::integer() const {
  if (!value_->is_number_integer()) damaged("must be an integer");
  if (value_->is_number_unsigned() && value_->get<std::uint64_t>() >> 63 != 0)
    damaged("is too large");
  return value_->get<Index>();
}

Index JsonReader::positive() const {
  const Index value = integer();
  if (value < 1 || value > Index{1} << 62) damaged(fmt::format("{} is out of bounds", value));
  return value;
}

void JsonReader::check_version(const char* what, Index known, const char* renewal) const {
  const Index version = integer();
  if (version != known)
    unsupported(fmt::format("{} version {} is not known to this program, which knows {}; {}", what,
                            version, known,
                            version < known ? renewal : "use a newer version of isobrick"));
}

}  // namespace isobrick
