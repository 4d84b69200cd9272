#include "isobrick/io/detached_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <utility>

#include "isobrick/core/error.h"
#include "isobrick/io/file.h"

namespace isobrick {
namespace {

/// As much of a header as a message should show.
std::string quoted(std::string_view text) {
  std::string shown = "'";
  for (const char c : text.substr(0, 60)) shown += c >= 0x20 && c < 0x7f ? c : '?';
  return shown + (text.size() > 60 ? "…'" : "'");
}

constexpr std::string_view kBlanks = " \t\r";

double dot(Vec3d a, Vec3d b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

}  // namespace

void header_error(const std::string& path, const std::string& what) {
  throw UsageError(fmt::format("'{}': {}", path, what));
}

std::string read_header_text(const std::string& path) {
  const InputFile file = open_input(path);
  if (file.size > kMostHeader)
    header_error(path, fmt::format("the header is {} bytes long, more than the {} allowed",
                                   file.size, kMostHeader));
  std::string text(file.size, '\0');
  read_at(file.fd.get(), path, 0, reinterpret_cast<std::byte*>(text.data()), text.size());
  if (const std::size_t at = text.find('\0'); at != std::string::npos)
    header_error(path, fmt::format("not a text header: it has a NUL byte at offset {}", at));
  return text;
}

std::string_view next_line(std::string_view& text) {
  const std::size_t end = std::min(text.find('\n'), text.size());
  std::string_view line = text.substr(0, end);
  text.remove_prefix(std::min(end + 1, text.size()));
  if (line.ends_with('\r')) line.remove_suffix(1);
  return line;
}

std::string_view trim(std::string_view text) {
  const std::size_t first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return result;
}

std::vector<std::string_view> split_words(std::string_view text) {
  std::vector<std::string_view> words;
  for (text = trim(text); !text.empty(); text = trim(text)) {
    const std::size_t end = std::min(text.find_first_of(kBlanks), text.size());
    words.push_back(text.substr(0, end));
    text.remove_prefix(end);
  }
  return words;
}

Index parse_integer(const std::string& path, std::string_view field, std::string_view word) {
  Index value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error == std::errc::result_out_of_range)
    header_error(path, fmt::format("{}: {} is too large", field, quoted(word)));
  if (error != std::errc{} || end != word.data() + word.size())
    header_error(path, fmt::format("{}: {} is not a whole number", field, quoted(word)));
  return value;
}

double parse_real(const std::string& path, std::string_view field, std::string_view word,
                  bool nan_allowed) {
  double value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size() ||
      !(std::isfinite(value) || (nan_allowed && std::isnan(value))))
    header_error(path, fmt::format("{}: {} is not a usable number", field, quoted(word)));
  return value;
}

std::string resolve_data_file(const std::string& path, std::string_view name) {
  if (name.empty()) header_error(path, "the name of the data file is empty");
  if (lower(split_words(name)[0]) == "list" || name.find('%') != std::string_view::npos)
    header_error(path, fmt::format("samples spread over several files ({}) are not supported",
                                   quoted(name)));
  const std::filesystem::path data(name);
  if (data.is_absolute() || std::find(data.begin(), data.end(), "..") != data.end())
    header_error(path, fmt::format("the data file {} is outside the header's folder; give the "
                                   "data file itself with its extent and type",
                                   quoted(name)));
  return (std::filesystem::path(path).parent_path() / data).string();
}

void set_axes(const std::string& path, Transform& transform, const Vec3d (&axes)[3]) {
  for (int axis = 0; axis < 3; ++axis) {
    const double length = std::sqrt(dot(axes[axis], axes[axis]));
    if (!std::isfinite(length) || length <= 0)
      header_error(path, fmt::format("the direction of axis {} has no length", axis));
    transform.spacing[axis] = length;
    for (int row = 0; row < 3; ++row)
      transform.direction[static_cast<std::size_t>(3 * row + axis)] = axes[axis][row] / length;
  }
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3;
    // Loose: headers carry few digits.
    if (std::abs(dot(axes[a], axes[b])) > 1e-3 * transform.spacing[a] * transform.spacing[b])
      header_error(path, fmt::format("axes {} and {} are not at right angles, which is not "
                                     "supported",
                                     a, b));
  }
}

std::string unit_name(std::string_view unit) {
  constexpr std::pair<std::string_view, std::string_view> names[] = {
      {"m", "meter"},       {"cm", "centimeter"}, {"mm", "millimeter"}, {"um", "micrometer"},
      {"µm", "micrometer"}, {"μm", "micrometer"}, {"nm", "nanometer"},  {"pm", "picometer"},
      {"km", "kilometer"},  {"in", "inch"},       {"ft", "foot"},       {"å", "angstrom"},
  };
  for (const auto& [symbol, name] : names)
    if (unit == symbol || unit == name) return std::string(name);
  if (unit == "micron" || unit == "microns") return "micrometer";
  return {};
}

}  // namespace isobrick
