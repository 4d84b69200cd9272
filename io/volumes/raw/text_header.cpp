#include "io/volumes/raw/text_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <utility>

#include <isobrick/error.h>
#include "core/printable.h"
#include "io/bytes/file.h"

namespace isobrick::inline v0 {
namespace {

/// As much of a header as a message should show.
std::string excerpt(std::string_view text) {
  return fmt::format("'{}{}'", printable(text, 60), text.size() > 60 ? "…" : "");
}

constexpr std::string_view kBlanks = " \t\r";

/// Axes that few digits left a little off right angles are put right, x first.
void square(std::array<double, 9>& direction) {
  Vec3d axes[3];
  for (std::size_t i = 0; i < 9; ++i) axes[i % 3][static_cast<int>(i / 3)] = direction[i];
  const auto off = [&](int a, int b) { return std::abs(dot(axes[a], axes[b])); };
  if (std::max({off(0, 1), off(1, 2), off(2, 0)}) < 1e-6) return;
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < a; ++b) axes[a] = axes[a] - axes[b] * dot(axes[a], axes[b]);
    axes[a] = axes[a] * (1 / std::sqrt(dot(axes[a], axes[a])));
  }
  for (std::size_t i = 0; i < 9; ++i) direction[i] = axes[i % 3][static_cast<int>(i / 3)];
}

}  // namespace

void header_error(const std::string& path, const std::string& what) {
  throw UsageError(fmt::format("'{}': {}", path, what));
}

File open_data_file(const std::string& path, const std::string& header) {
  if (path == header) return open_input(path);
  const auto message = [&](const Error& error) {
    return fmt::format("{}; the header '{}' needs it", error.what(), header);
  };
  try {
    return open_input(path);
  } catch (const UsageError& error) {
    throw UsageError(message(error));
  } catch (const Error& error) {
    throw Error(message(error));
  }
}

HeaderLines::HeaderLines(const std::string& path) : path_(path) {
  const File file = open_input(path);
  file_size_ = file.size();
  text_ = file.text_at(0, kMaxHeader);
  rest_ = text_;
}

std::string_view HeaderLines::next() {
  const std::size_t end = std::min(rest_.find('\n'), rest_.size());
  if (end == rest_.size() && text_.size() < file_size_)
    header_error(path_, fmt::format("the header does not end within its first {} bytes (of {})",
                                    kMaxHeader, file_size_));
  std::string_view line = rest_.substr(0, end);
  if (const std::size_t at = line.find('\0'); at != std::string_view::npos)
    header_error(path_,
                 fmt::format("not a text header: it has a NUL byte at offset {}", position() + at));
  rest_.remove_prefix(std::min(end + 1, rest_.size()));
  if (line.ends_with('\r')) line.remove_suffix(1);
  return line;
}

void HeaderLines::skip(std::uint64_t bytes) {
  if (bytes > rest_.size())
    header_error(path_, fmt::format("the header does not end within its first {} bytes (of {})",
                                    text_.size(), file_size_));
  rest_.remove_prefix(static_cast<std::size_t>(bytes));
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
    header_error(path, fmt::format("{}: {} is too large", field, excerpt(word)));
  if (error != std::errc{} || end != word.data() + word.size())
    header_error(path, fmt::format("{}: {} is not a whole number", field, excerpt(word)));
  return value;
}

double parse_real(const std::string& path, std::string_view field, std::string_view word,
                  bool nan_allowed) {
  double value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size() ||
      !(std::isfinite(value) || (nan_allowed && std::isnan(value))))
    header_error(path, fmt::format("{}: {} is not a usable number", field, excerpt(word)));
  return value;
}

std::string resolve_data_file(const std::string& path, std::string_view name) {
  if (name.empty()) header_error(path, "the name of the data file is empty");
  const std::filesystem::path data(name);
  if (data.is_absolute() || std::find(data.begin(), data.end(), "..") != data.end())
    header_error(path, fmt::format("the data file {} is outside the header's folder; give the "
                                   "data file itself with its extent and type",
                                   excerpt(name)));
  return (std::filesystem::path(path).parent_path() / data).string();
}

std::vector<std::string> resolve_data_pattern(const std::string& path, std::string_view text) {
  constexpr Index kMaxFiles = 1'000'000;
  constexpr std::size_t kMaxText = std::size_t{64} << 20;
  constexpr Index kMaxDigits = 20;
  const auto words = split_words(text);
  if (words.size() != 3 && words.size() != 4)
    header_error(path, fmt::format("{} is not 'PATTERN FIRST LAST [STEP]'", excerpt(text)));
  const auto number = [&](std::size_t i) { return parse_integer(path, "data file", words[i]); };
  const Index first = number(1), last = number(2), step = words.size() == 4 ? number(3) : 1;
  const bool ordered =
      first >= 0 && last >= 0 && (step > 0 ? last >= first : step < 0 && last <= first);
  const Index count = ordered ? std::min((last - first) / step, kMaxFiles) + 1 : 0;
  // A number in a name takes no more characters than the largest one or the widest pattern.
  const std::size_t name = path.size() + words[0].size() + static_cast<std::size_t>(kMaxDigits);
  if (count < 1 || count > kMaxFiles || static_cast<std::size_t>(count) * name > kMaxText)
    header_error(path, fmt::format("the numbers of {} make no sense", excerpt(text)));
  const std::string_view pattern = words[0];
  const std::size_t percent = pattern.find('%');
  const std::size_t end = pattern.find_first_not_of("0123456789", percent + 1);
  const std::string_view width = pattern.substr(percent + 1, end - percent - 1);
  if (end == std::string_view::npos || pattern[end] != 'd' ||
      pattern.find('%', end) != std::string_view::npos || width.size() > 3)
    header_error(path,
                 fmt::format("{} is no pattern with one number such as %03d", excerpt(pattern)));
  const Index digits = width.empty() ? 0 : parse_integer(path, "data file", width);
  if (digits > kMaxDigits)
    header_error(path,
                 fmt::format("{}: numbers of {} digits make no sense", excerpt(pattern), digits));
  std::vector<std::string> names;
  for (Index i = 0; i < count; ++i) {
    std::string text_of_number = std::to_string(first + i * step);
    if (static_cast<Index>(text_of_number.size()) < digits)
      text_of_number.insert(0, static_cast<std::size_t>(digits) - text_of_number.size(),
                            width.starts_with('0') ? '0' : ' ');
    names.push_back(resolve_data_file(path, std::string(pattern.substr(0, percent)) +
                                                text_of_number +
                                                std::string(pattern.substr(end + 1))));
  }
  return names;
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
  square(transform.direction);
}

}  // namespace isobrick
