#include "io/volumes/raw/raw_name.h"

#include <cctype>
#include <charconv>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace isobrick::inline v0 {
namespace {

std::vector<std::string> words_of(std::string_view stem) {
  std::vector<std::string> words(1);
  for (const char c : stem) {
    if (std::string_view("_-. ").find(c) != std::string_view::npos)
      words.emplace_back();
    else
      words.back() += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return words;
}

std::optional<Int3> parse_extent_word(std::string_view word) {
  Int3 extent;
  const char* at = word.data();
  const char* const end = at + word.size();
  for (int axis = 0; axis < 3; ++axis) {
    if (axis > 0 && (at == end || *at++ != 'x')) return std::nullopt;
    if (at == end || *at == '-') return std::nullopt;
    const auto [next, error] = std::from_chars(at, end, extent[axis]);
    if (error == std::errc::invalid_argument) return std::nullopt;
    if (error == std::errc::result_out_of_range) extent[axis] = std::numeric_limits<Index>::max();
    at = next;
  }
  return at == end ? std::optional(extent) : std::nullopt;
}

std::optional<ScalarType> parse_type_word(std::string_view word) {
  constexpr std::pair<std::string_view, ScalarType> others[] = {
      {"uchar", ScalarType::u8},  {"ushort", ScalarType::u16}, {"short", ScalarType::i16},
      {"float", ScalarType::f32}, {"double", ScalarType::f64},
  };
  for (const auto& [name, type] : others)
    if (word == name) return type;
  return parse_scalar_type(word);
}

}  // namespace

RawName parse_raw_name(std::string_view stem) {
  const std::vector<std::string> words = words_of(stem);
  RawName found;
  std::size_t after_extent = 0;
  for (std::size_t i = 0; i < words.size(); ++i)
    if (const auto extent = parse_extent_word(words[i])) {
      found.extent = extent;
      after_extent = i + 1;
    }
  for (std::size_t i = 0; i < words.size() && !found.type; ++i)
    found.type = parse_type_word(words[(after_extent + i) % words.size()]);
  return found;
}

}  // namespace isobrick
