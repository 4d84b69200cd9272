#include "io/meshes/readers/ply_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <utility>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

constexpr std::size_t kMaxHeader = 1 << 20;

NumberKind parse_kind(const std::string& path, std::string_view word) {
  static constexpr std::array<std::pair<std::string_view, NumberKind>, 16> kinds{
      {{"char", NumberKind::i8},
       {"int8", NumberKind::i8},
       {"uchar", NumberKind::u8},
       {"uint8", NumberKind::u8},
       {"short", NumberKind::i16},
       {"int16", NumberKind::i16},
       {"ushort", NumberKind::u16},
       {"uint16", NumberKind::u16},
       {"int", NumberKind::i32},
       {"int32", NumberKind::i32},
       {"uint", NumberKind::u32},
       {"uint32", NumberKind::u32},
       {"float", NumberKind::f32},
       {"float32", NumberKind::f32},
       {"double", NumberKind::f64},
       {"float64", NumberKind::f64}}};
  for (const auto& [name, kind] : kinds)
    if (name == word) return kind;
  fail_ply(path, fmt::format("'{}' is no type of a property", word));
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (std::size_t at = 0; at < line.size();) {
    const std::size_t begin = line.find_first_not_of(" \t\r", at);
    if (begin == line.npos) break;
    const std::size_t end = std::min(line.find_first_of(" \t\r", begin), line.size());
    words.push_back(line.substr(begin, end - begin));
    at = end;
  }
  return words;
}

void take_format(const std::string& path, PlyHeader& header, std::string_view word) {
  header.text = word == "ascii";
  if (!header.text && word != "binary_little_endian" && word != "binary_big_endian")
    fail_ply(path, fmt::format("its format is '{}'", word));
  header.swapped = word == "binary_big_endian";
}

void take_element(const std::string& path, PlyHeader& header,
                  const std::vector<std::string_view>& words) {
  PlyElement& element = header.elements.emplace_back();
  element.name = words[1];
  const auto [end, error] =
      std::from_chars(words[2].data(), words[2].data() + words[2].size(), element.count);
  if (error != std::errc() || end != words[2].data() + words[2].size())
    fail_ply(path, fmt::format("'{}' is no number of elements", words[2]));
}

void take_property(const std::string& path, PlyHeader& header,
                   const std::vector<std::string_view>& words) {
  if (header.elements.empty()) fail_ply(path, "a property belongs to no element");
  std::vector<PlyProperty>& properties = header.elements.back().properties;
  if (words.size() == 3)
    properties.push_back({std::string(words[2]), parse_kind(path, words[1])});
  else if (words.size() == 5 && words[1] == "list")
    properties.push_back(
        {std::string(words[4]), parse_kind(path, words[3]), true, parse_kind(path, words[2])});
  else
    fail_ply(path, "a property is not of the form TYPE NAME");
}

}  // namespace

void fail_ply(const std::string& path, const std::string& what) {
  throw Error(fmt::format("'{}' is no PLY file that can be drawn: {}", path, what));
}

std::optional<std::uint64_t> PlyElement::row_bytes() const {
  std::uint64_t bytes = 0;
  for (const PlyProperty& property : properties) {
    if (property.list) return std::nullopt;
    bytes += size_of(property.kind);
  }
  return bytes;
}

std::optional<std::array<std::size_t, 3>> PlyElement::find(
    const std::array<std::string_view, 3>& names) const {
  std::array<std::size_t, 3> places{};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto at = std::find_if(properties.begin(), properties.end(),
                                 [&](const PlyProperty& p) { return p.name == names[i]; });
    if (at == properties.end() || at->list) return std::nullopt;
    places[i] = static_cast<std::size_t>(at - properties.begin());
  }
  return places;
}

std::optional<std::array<std::size_t, 3>> PlyElement::find_colours() const {
  if (const auto places = find({"red", "green", "blue"})) return places;
  return find({"diffuse_red", "diffuse_green", "diffuse_blue"});
}

std::size_t PlyElement::find_corners(const std::string& path) const {
  for (std::size_t i = 0; i < properties.size(); ++i)
    if (properties[i].list &&
        (properties[i].name == "vertex_indices" || properties[i].name == "vertex_index"))
      return i;
  fail_ply(path, "its faces name no vertices");
}

double ply_colour_scale(NumberKind kind) {
  if (kind == NumberKind::f32 || kind == NumberKind::f64) return 1;
  return size_of(kind) == 1 ? 1.0 / 255 : 1.0 / 65535;
}

PlyHeader parse_ply_header(const std::string& path, std::string_view text) {
  PlyHeader header;
  text = text.substr(0, kMaxHeader);
  for (std::size_t at = 0;;) {
    const std::size_t end = text.find('\n', at);
    if (end == text.npos) fail_ply(path, "its header does not end");
    const std::string_view line = text.substr(at, end - at);
    const std::vector<std::string_view> words = words_of(line);
    at = end + 1;
    ++header.lines;
    constexpr std::string_view comment = "comment ";
    if (header.unit.empty() && line.starts_with(comment))
      header.unit = unit_of_comment(line.substr(comment.size()));
    if (words.empty() || words[0] == "ply" || words[0] == "comment" || words[0] == "obj_info")
      continue;
    if (words[0] == "end_header") {
      header.bytes = at;
      return header;
    }
    if (words[0] == "format" && words.size() == 3)
      take_format(path, header, words[1]);
    else if (words[0] == "element" && words.size() == 3)
      take_element(path, header, words);
    else if (words[0] == "property")
      take_property(path, header, words);
    else
      fail_ply(path, fmt::format("its header has '{}'", words[0]));
  }
}

}  // namespace isobrick
