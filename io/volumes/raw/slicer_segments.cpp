#include "io/volumes/raw/slicer_segments.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <utility>

#include "core/printable.h"
#include "io/bytes/xml_text.h"
#include "io/volumes/raw/text_header.h"

namespace isobrick::inline v0 {
namespace {

/// "0.5 0.68 0.45": red, green and blue from 0 to 1.
std::optional<std::array<std::uint8_t, 4>> parse_segment_colour(const std::string& text) {
  std::array<std::uint8_t, 4> colour{0, 0, 0, 255};
  const auto words = split_words(text);
  if (words.size() != 3) return std::nullopt;
  for (std::size_t i = 0; i < 3; ++i) {
    double part = 0;
    const auto [end, error] =
        std::from_chars(words[i].data(), words[i].data() + words[i].size(), part);
    if (error != std::errc{} || !(part >= 0 && part <= 1)) return std::nullopt;
    colour[i] = static_cast<std::uint8_t>(std::lround(part * 255));
  }
  return colour;
}

/// UTF-8 as it is.
std::string segment_name(const std::string& text) {
  constexpr std::size_t kMaxName = 1000;
  return text.size() <= kMaxName && is_xml_text(text) ? text : printable(text, kMaxName);
}

/// In ascending order; the first of those with one label.
void sort_by_label(LabelTable& table) {
  std::stable_sort(table.begin(), table.end(),
                   [](const auto& a, const auto& b) { return a.label < b.label; });
  const auto repeated = std::unique(
      table.begin(), table.end(), [](const auto& a, const auto& b) { return a.label == b.label; });
  table.erase(repeated, table.end());
}

}  // namespace

std::optional<LabelTable> read_slicer_segments(
    const std::function<std::string(const std::string& key)>& pair, Index layer) {
  std::optional<LabelTable> table;
  for (int i = 0;; ++i) {
    const auto field = [&](const char* key) { return pair(fmt::format("Segment{}_{}", i, key)); };
    if (field("ID").empty()) break;
    if (!table) table.emplace();
    const auto label = Label::parse(field("LabelValue"));
    if (!label || Label::parse(field("Layer")).value_or(0) != layer) continue;
    table->push_back({.label = *label,
                      .name = segment_name(field("Name")),
                      .colour = parse_segment_colour(field("Color"))});
  }
  if (table) sort_by_label(*table);
  return table;
}

}  // namespace isobrick
