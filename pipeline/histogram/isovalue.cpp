#include <isobrick/isovalue.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include <isobrick/error.h>
#include "bricks/level_set.h"
#include "pipeline/value_text.h"

namespace isobrick::inline v0 {
namespace {

struct Preset {
  std::string_view name;
  double hounsfield;
};

/// Fat to enamel: the lower bounds of InVesalius's threshold presets for adults. Skin and lung are
/// midway between air (-1000) and what it touches.
constexpr std::array kPresets{Preset{"ct-lung", -500},  Preset{"ct-skin", -300},
                              Preset{"ct-fat", -205},   Preset{"ct-muscle", -5},
                              Preset{"ct-bone", 226},   Preset{"ct-compact-bone", 662},
                              Preset{"ct-enamel", 1553}};

/// More values than this are no labels.
constexpr std::size_t kMaxLabels = 32;

[[noreturn]] void refuse(std::string_view text) {
  throw UsageError(fmt::format(
      "'{}' is no isovalue; it is a number, otsu, a percentile such as p99.5, a part of "
      "the range such as 50%, 300HU, a preset, or FROM:TO:STEP; the presets are {}",
      text, isovalue_presets()));
}

std::optional<double> number_of(std::string_view text) {
  double value = 0;
  if (text.starts_with('+')) text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value))
    return std::nullopt;
  return value;
}

std::string_view without_blanks(std::string_view text) {
  while (text.starts_with(' ')) text.remove_prefix(1);
  while (text.ends_with(' ')) text.remove_suffix(1);
  return text;
}

double percent_of(std::string_view text, std::string_view all) {
  const auto percent = number_of(text);
  if (!percent) refuse(all);
  if (!(*percent >= 0 && *percent <= 100))
    throw UsageError(fmt::format("'{}' is no percentage; it lies within 0 and 100", all));
  return *percent;
}

IsovalueRequest parse_one(std::string_view text) {
  using Kind = IsovalueRequest::Kind;
  if (text == "otsu") return {Kind::otsu, 0};
  for (const Preset& preset : kPresets)
    if (text == preset.name) return {Kind::hounsfield, preset.hounsfield};
  if (const auto number = number_of(text)) return {Kind::value, *number};
  if (text.ends_with('%'))
    return {Kind::percent_of_range, percent_of(text.substr(0, text.size() - 1), text)};
  if (text.starts_with('p')) return {Kind::percentile, percent_of(text.substr(1), text)};
  if (text.ends_with("HU"))
    if (const auto number = number_of(text.substr(0, text.size() - 2)))
      return {Kind::hounsfield, *number};
  refuse(text);
}

/// "FROM:TO:STEP", both ends included.
void append_steps(std::string_view text, std::vector<IsovalueRequest>& requests) {
  const auto first = text.find(':'), second = text.find(':', first + 1);
  if (second == text.npos) refuse(text);
  const auto from = number_of(text.substr(0, first));
  const auto to = number_of(text.substr(first + 1, second - first - 1));
  const auto step = number_of(text.substr(second + 1));
  if (!from || !to || !step) refuse(text);
  // A last step that rounding puts behind the end is one.
  const double steps = std::floor((*to - *from) / *step * (1 + 1e-12) + 1e-9);
  if (*step == 0 || !(steps >= 0))
    throw UsageError(fmt::format("'{}': the step does not lead from {} to {}", text, *from, *to));
  if (!(steps < static_cast<double>(kMaxIsovalues)))
    throw UsageError(fmt::format("'{}' is more than {} isovalues", text, kMaxIsovalues));
  // 12 digits: 0.15 and not 0.15000000000000002, which would be in the names of meshes.
  for (double i = 0; i <= steps; ++i)
    requests.push_back(
        {IsovalueRequest::Kind::value, *number_of(fmt::format("{:.12g}", *from + i * *step))});
}

void check_hounsfield(const Histogram& histogram, ScalarType type) {
  const bool has_sign =
      type != ScalarType::u8 && type != ScalarType::u16 && type != ScalarType::u32;
  if (has_sign) return;
  throw UsageError(
      fmt::format("the samples, {} to {}, are not in Hounsfield units, in which air is -1000; give "
                  "the isovalue as a number",
                  sample_text(histogram.lo, type), sample_text(histogram.hi, type)));
}

/// Half the width of a bin, from its middle value to its upper bound.
double half_bin(const Histogram& histogram) { return 0.5 * histogram.bin_width; }

/// Percent of the finite samples in bins above the bound `value`.
double percent_above(const Histogram& histogram, double value) {
  std::uint64_t above = 0, all = 0;
  for (std::size_t i = 0; i < histogram.counts.size(); ++i) {
    all += histogram.counts[i];
    if (histogram.first + (static_cast<double>(i) + 0.5) * histogram.bin_width > value)
      above += histogram.counts[i];
  }
  return 100.0 * static_cast<double>(above) / static_cast<double>(all);
}

/// The lowest two values of labels; nothing where the samples are no labels.
std::optional<std::array<double, 2>> lowest_labels(const Histogram& histogram, ScalarType type) {
  if (is_floating(type) || histogram.bin_width != 1) return std::nullopt;
  std::vector<double> values;
  for (std::size_t i = 0; i < histogram.counts.size() && values.size() <= kMaxLabels; ++i)
    if (histogram.counts[i] > 0) values.push_back(histogram.first + static_cast<double>(i));
  if (values.size() < 2 || values.size() > kMaxLabels) return std::nullopt;
  return std::array{values[0], values[1]};
}

}  // namespace

std::string isovalue_presets() {
  std::string text;
  for (const Preset& preset : kPresets)
    text += fmt::format("{}{} ({} HU)", text.empty() ? "" : ", ", preset.name, preset.hounsfield);
  return text;
}

std::vector<IsovalueRequest> parse_isovalues(std::string_view text) {
  std::vector<IsovalueRequest> requests;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string_view part = without_blanks(text.substr(begin, end - begin));
    if (part.find(':') != part.npos)
      append_steps(part, requests);
    else
      requests.push_back(parse_one(part));
    begin = end + 1;
  }
  if (requests.size() > kMaxIsovalues)
    throw UsageError(fmt::format("'{}' is more than {} isovalues", text, kMaxIsovalues));
  return requests;
}

bool needs_histogram(const IsovalueRequest& request) {
  return request.kind != IsovalueRequest::Kind::value;
}

double resolve_isovalue(const IsovalueRequest& request, const Histogram& histogram,
                        ScalarType type) {
  using Kind = IsovalueRequest::Kind;
  if (request.kind == Kind::value) return request.number;
  if (histogram.counts.empty()) throw UsageError("no sample is a finite number");
  switch (request.kind) {
    case Kind::otsu:
      if (const auto threshold = otsu(histogram)) return *threshold + half_bin(histogram);
      throw UsageError(fmt::format("all samples are {}: Otsu's method finds no threshold",
                                   sample_text(histogram.lo, type)));
    case Kind::percentile: return *percentile(histogram, request.number);
    case Kind::percent_of_range:
      // Each part for itself: the whole range may be no finite number.
      return histogram.lo * (1 - request.number / 100) + histogram.hi * (request.number / 100);
    case Kind::hounsfield: check_hounsfield(histogram, type); return request.number;
    case Kind::value: break;
  }
  return request.number;
}

std::vector<double> resolve_isovalues(std::span<const IsovalueRequest> requests, ScalarType type,
                                      const std::function<Histogram()>& samples) {
  Histogram counted;
  if (std::any_of(requests.begin(), requests.end(), needs_histogram)) counted = samples();
  std::vector<double> isovalues;
  for (const IsovalueRequest& request : requests) {
    const double isovalue = resolve_isovalue(request, counted, type);
    if (std::find(isovalues.begin(), isovalues.end(), isovalue) == isovalues.end())
      isovalues.push_back(isovalue);
  }
  return isovalues;
}

std::optional<SuggestedIsovalue> suggest_isovalue(const StoreInfo& info,
                                                  const Histogram& histogram) {
  if (is_level_set(info)) return SuggestedIsovalue{0, "the surface of the level set"};
  return suggest_isovalue(info.type, histogram);
}

std::optional<SuggestedIsovalue> suggest_isovalue(ScalarType type, const Histogram& histogram) {
  if (const auto labels = lowest_labels(histogram, type))
    return SuggestedIsovalue{0.5 * ((*labels)[0] + (*labels)[1]),
                             fmt::format("between {} and the labels above it", (*labels)[0])};
  const auto threshold = otsu(histogram);
  if (!threshold) return std::nullopt;
  const double value = *threshold + half_bin(histogram);
  return SuggestedIsovalue{
      value,
      fmt::format("Otsu's threshold, which divides the samples into two classes; {:.1f} % are "
                  "above it",
                  percent_above(histogram, value))};
}

}  // namespace isobrick
