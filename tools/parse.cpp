#include "tools/parse.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include <isobrick/error.h>
#include <isobrick/lattice.h>
#include "viewer/render/preview_options.h"

namespace isobrick::tools {
namespace {

template <class T>
std::optional<T> whole_text(std::string_view text) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// Cuts "a,b,c" at its commas; nothing unless there are exactly three parts.
std::optional<std::array<std::string_view, 3>> split3(std::string_view text) {
  const auto first = text.find(',');
  if (first == std::string_view::npos) return std::nullopt;
  const auto second = text.find(',', first + 1);
  if (second == std::string_view::npos || text.find(',', second + 1) != std::string_view::npos)
    return std::nullopt;
  return {
      {text.substr(0, first), text.substr(first + 1, second - first - 1), text.substr(second + 1)}};
}

/// The three parts of "X0:X1,Y0:Y1,Z0:Z1".
std::array<std::string_view, 3> split_box(std::string_view text) {
  if (const auto parts = split3(text)) return *parts;
  throw UsageError(fmt::format("'{}' is not of the form X0:X1,Y0:Y1,Z0:Z1", text));
}

/// The power of two that a unit stands for, or nothing: "", K, M, G, T with "B" or "iB".
std::optional<int> unit_shift(std::string_view unit) {
  if (unit.empty() || unit == "B") return 0;
  constexpr std::string_view letters = "KMGT";
  const auto at = letters.find(unit[0] >= 'a' ? static_cast<char>(unit[0] - 'a' + 'A') : unit[0]);
  const std::string_view rest = unit.substr(1);
  if (at == std::string_view::npos || !(rest.empty() || rest == "B" || rest == "iB"))
    return std::nullopt;
  return 10 * (static_cast<int>(at) + 1);
}

}  // namespace

std::uint64_t parse_bytes(std::string_view text) {
  double number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  const std::string_view unit(end, static_cast<std::size_t>(text.data() + text.size() - end));
  const auto shift = unit_shift(unit);
  if (error != std::errc{} || !shift || !(number > 0))
    throw UsageError(fmt::format("'{}' is no size; write it like 100000, 512M or 1.5G", text));
  const double bytes = std::floor(std::ldexp(number, *shift));
  if (bytes < 1 || bytes >= std::ldexp(1.0, 63))
    throw UsageError(fmt::format("the size '{}' is out of range", text));
  return static_cast<std::uint64_t>(bytes);
}

Index parse_whole(std::string_view text, Index least, Index most) {
  const auto value = whole_text<Index>(text);
  if (value && *value >= least && *value <= most) return *value;
  if (most == std::numeric_limits<Index>::max())
    throw UsageError(fmt::format("'{}' is not a whole number of at least {}", text, least));
  throw UsageError(fmt::format("'{}' is not a whole number from {} to {}", text, least, most));
}

std::uint64_t parse_offset(std::string_view text) {
  return static_cast<std::uint64_t>(parse_whole(text, 0, std::numeric_limits<Index>::max()));
}

double parse_number(std::string_view text) {
  const bool plus = !text.empty() && text[0] == '+';
  const auto value = whole_text<double>(text.substr(plus ? 1 : 0));
  if (!value || !std::isfinite(*value))
    throw UsageError(fmt::format("'{}' is not a finite number", text));
  return *value;
}

Int3 parse_dims(std::string_view text) {
  const auto parts = split3(text);
  if (!parts) throw UsageError(fmt::format("'{}' is not of the form X,Y,Z", text));
  Int3 dims;
  for (int axis = 0; axis < 3; ++axis)
    dims[axis] =
        parse_whole((*parts)[static_cast<std::size_t>(axis)], 1, std::numeric_limits<Index>::max());
  if (!checked_volume(dims))
    throw UsageError(fmt::format("a volume of {} samples is too large to address", text));
  return dims;
}

Vec3d parse_vector(std::string_view text) {
  const auto parts = split3(text);
  if (!parts) throw UsageError(fmt::format("'{}' is not of the form X,Y,Z", text));
  return {parse_number((*parts)[0]), parse_number((*parts)[1]), parse_number((*parts)[2])};
}

HalfSpace parse_half_space(std::string_view text) {
  const auto comma = text.rfind(',');
  const auto normal = split3(text.substr(0, comma == text.npos ? 0 : comma));
  if (!normal) throw UsageError(fmt::format("'{}' is not of the form NX,NY,NZ,D", text));
  const HalfSpace half{parse_vector(text.substr(0, comma)), parse_number(text.substr(comma + 1))};
  if (half.normal == Vec3d{})
    throw UsageError(fmt::format("the plane '{}' has no direction", text));
  return half;
}

Inside parse_inside(std::string_view text) {
  if (text == "above") return Inside::above;
  if (text == "below") return Inside::below;
  throw UsageError(fmt::format("'{}' is no side of a surface; it is above or below", text));
}

Topology parse_topology(std::string_view text) {
  if (text == "consistent") return Topology::consistent;
  if (text == "trilinear") return Topology::trilinear;
  throw UsageError(fmt::format("'{}' is no topology; it is consistent or trilinear", text));
}

Backend parse_backend(std::string_view text) {
  if (text == "auto") return Backend::automatic;
  if (text == "cpu") return Backend::cpu;
  if (text == "cuda") return Backend::cuda;
  throw UsageError(fmt::format("'{}' is no backend; it is auto, cpu or cuda", text));
}

PictureSize parse_picture_size(std::string_view text) {
  const auto by = text.find('x');
  if (by == std::string_view::npos)
    throw UsageError(fmt::format("'{}' is not of the form WIDTHxHEIGHT", text));
  return {parse_int(text.substr(0, by), kMinPictureEdge, kMaxPictureEdge),
          parse_int(text.substr(by + 1), kMinPictureEdge, kMaxPictureEdge)};
}

Part parse_part(std::string_view text) {
  const std::size_t slash = text.find('/');
  if (slash == text.npos)
    throw UsageError(fmt::format("'{}' is no part; write it I/N, such as 3/8", text));
  Part part;
  part.count = static_cast<std::uint32_t>(parse_int(text.substr(slash + 1), 1, kMaxParts));
  part.number =
      static_cast<std::uint32_t>(parse_int(text.substr(0, slash), 1, static_cast<int>(part.count)));
  return part;
}

bool parse_normals(const std::string& text) {
  if (text == "gradient") return true;
  if (text == "none") return false;
  throw UsageError(fmt::format("'{}' is no kind of normals; it is gradient or none", text));
}

Vec3f parse_colour(std::string_view text) {
  constexpr std::string_view digits = "0123456789abcdef";
  if (text == "white") return {1, 1, 1};
  if (text == "black") return {0, 0, 0};
  Vec3f colour;
  bool good = text.size() == 7 && text[0] == '#';
  for (std::size_t i = 0; good && i < 6; ++i) {
    const char c = text[i + 1];
    const auto digit = digits.find(c >= 'A' && c <= 'F' ? static_cast<char>(c + 32) : c);
    good = digit != digits.npos;
    colour[static_cast<int>(i / 2)] += static_cast<float>(i % 2 ? digit : 16 * digit) / 255;
  }
  if (good) return colour;
  throw UsageError(fmt::format("'{}' is no colour; it is #RRGGBB, white or black", text));
}

ScalarType parse_type(std::string_view text) {
  if (const auto type = parse_scalar_type(text)) return *type;
  throw UsageError(fmt::format(
      "unknown type '{}'; the types are u8, i8, u16, i16, u32, i32, f32, f64, u64, i64", text));
}

ByteOrder parse_byte_order(std::string_view text) {
  if (text == "little") return ByteOrder::little;
  if (text == "big") return ByteOrder::big;
  throw UsageError(fmt::format("'{}' is no byte order; it is little or big", text));
}

namespace {

double parse_factor(std::string_view text) {
  const double factor = parse_number(text);
  if (factor > 0 && std::isfinite(factor)) return factor;
  throw UsageError(fmt::format("a factor of '{}': it is a positive number, such as 1.1", text));
}

}  // namespace

Compression parse_codec(std::string_view text) {
  constexpr std::string_view zstd = "zstd";
  if (text == "none") return {BrickCodec::none};
  if (text == "packed") return {BrickCodec::packed};
  if (text == zstd) return {};
  if (text == "auto") return {BrickCodec::automatic};
  if (text.starts_with("auto:")) return {BrickCodec::automatic, 3, parse_factor(text.substr(5))};
  if (!text.starts_with("zstd:"))
    throw UsageError(
        fmt::format("unknown codec '{}'; it is zstd:LEVEL, packed, none or auto:FACTOR", text));
  return {BrickCodec::zstd, parse_int(text.substr(zstd.size() + 1), 1, 22)};
}

std::optional<int> parse_levels(std::string_view text) {
  if (text == "auto") return std::nullopt;
  return parse_int(text, 1, 64);
}

Downsampling parse_downsampling_name(std::string_view text) {
  if (const auto method = parse_downsampling(text)) return *method;
  throw UsageError(fmt::format("unknown method '{}'; it is mean, max, min, mode or stride", text));
}

RoiText parse_roi(std::string_view text) {
  const auto parts = split_box(text);
  constexpr Index most = Index{1} << 32;
  RoiText roi;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::string_view part = parts[axis];
    if (part.empty()) continue;
    const auto colon = part.find(':');
    if (colon == std::string_view::npos)
      throw UsageError(fmt::format("'{}' in '{}' is not of the form FROM:TO", part, text));
    if (colon > 0) roi.lo[axis] = parse_whole(part.substr(0, colon), -most, most);
    if (colon + 1 < part.size()) roi.hi[axis] = parse_whole(part.substr(colon + 1), -most, most);
  }
  return roi;
}

WorldRegion parse_world_region(std::string_view text) {
  constexpr double kFar = 1e30;  // beyond every mesh, and no infinity that would make NaN
  const auto parts = split_box(text);
  WorldRegion region;
  for (int axis = 0; axis < 3; ++axis) {
    const std::string_view part = parts[static_cast<std::size_t>(axis)];
    const auto colon = std::min(part.find(':'), part.size());
    if (colon == part.size() && !part.empty())
      throw UsageError(fmt::format("'{}' in '{}' is not of the form FROM:TO", part, text));
    const std::string_view lo = part.substr(0, colon),
                           hi = part.substr(std::min(colon + 1, part.size()));
    region.lo[axis] = lo.empty() ? -kFar : parse_number(lo);
    region.hi[axis] = hi.empty() ? kFar : parse_number(hi);
    if (!(region.lo[axis] < region.hi[axis]))
      throw UsageError(fmt::format("the box '{}' is empty", text));
  }
  return region;
}

Int3 parse_stride(std::string_view text) {
  constexpr Index most = Index{1} << 26;
  if (text.find(',') != text.npos) return parse_dims(text);
  const Index stride = parse_whole(text, 1, most);
  return {stride, stride, stride};
}

std::uint64_t parse_count(std::string_view text) {
  double number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  const std::string_view unit(end, static_cast<std::size_t>(text.data() + text.size() - end));
  const double factor = unit.empty()                 ? 1
                        : unit == "k" || unit == "K" ? 1e3
                        : unit == "M"                ? 1e6
                        : unit == "G"                ? 1e9
                                                     : 0;
  const double count = std::floor(number * factor);
  if (error != std::errc{} || factor == 0 || !(count >= 1 && count < 1e18))
    throw UsageError(fmt::format("'{}' is no count; write it like 200000, 500k or 1.5M", text));
  return static_cast<std::uint64_t>(count);
}

float parse_opacity(std::string_view text) {
  const double opacity = parse_number(text);
  if (!(opacity > 0 && opacity <= 1))
    throw UsageError(fmt::format("'{}' is no opacity; it is above 0, at most 1", text));
  return static_cast<float>(opacity);
}

}  // namespace isobrick::tools
