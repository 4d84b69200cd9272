#include "io/volumes/tiff/tiff_description.h"

#include <fmt/format.h>

#include <optional>
#include <string_view>

#include "core/length_unit.h"
#include "core/printable.h"
#include "io/volumes/raw/text_header.h"

namespace isobrick::inline v0 {
namespace {

Index read_count(const std::string& path, const char* name, std::string_view text) {
  constexpr Index kMax = Index{1} << 20;  // so that three of them can be multiplied
  const Index count = parse_integer(path, name, text);
  if (count < 1 || count > kMax)
    header_error(path, fmt::format("{} = {} makes no sense", name, count));
  return count;
}

double read_length(const std::string& path, const char* name, std::string_view text) {
  const double length = parse_real(path, name, text);
  return length > 0 ? length : 0;
}

/// `key=value` lines.
TiffDescription parse_image_j(const std::string& path, std::string_view text) {
  TiffDescription description;
  description.image_j = true;
  Index images = 1;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    const std::size_t equals = line.find('=');
    if (equals == std::string_view::npos) continue;
    const std::string_view key = line.substr(0, equals), value = trim(line.substr(equals + 1));
    if (key == "images") images = read_count(path, "images", value);
    if (key == "channels") description.channels = read_count(path, "channels", value);
    if (key == "slices") description.slices = read_count(path, "slices", value);
    if (key == "frames") description.times = read_count(path, "frames", value);
    if (key == "spacing") description.spacing.z = read_length(path, "spacing", value);
    // A micro sign that ImageJ could not write.
    if (key == "unit")
      description.unit = value == "\\u00B5m" ? "micrometer" : unit_name(lower(value));
  }
  if (description.slices == 0)
    description.slices = images / description.channels / description.times;
  return description;
}

/// The value of an attribute in the tag that `text` begins with.
std::optional<std::string_view> attribute(std::string_view text, std::string_view name) {
  const std::string_view tag = text.substr(0, text.find('>'));
  const std::string before = fmt::format(" {}=\"", name);
  const std::size_t at = tag.find(before);
  if (at == std::string_view::npos) return std::nullopt;
  const std::string_view rest = tag.substr(at + before.size());
  return rest.substr(0, rest.find('"'));
}

/// Spacing, in the unit of the first axis that has one; each axis has its own.
void read_physical_size(const std::string& path, std::string_view pixels,
                        TiffDescription& description) {
  constexpr const char* names[] = {"PhysicalSizeX", "PhysicalSizeY", "PhysicalSizeZ"};
  std::optional<std::string_view> first;
  for (int axis = 0; axis < 3; ++axis) {
    const auto value = attribute(pixels, names[axis]);
    const double length = value ? read_length(path, names[axis], *value) : 0;
    if (length == 0) continue;
    const auto unit = attribute(pixels, fmt::format("{}Unit", names[axis])).value_or("µm");
    if (!first) {
      first = unit;
      description.unit = unit_name(unit);
    }
    const auto ratio =
        unit == *first ? std::optional(1.0) : unit_ratio(unit_name(unit), description.unit);
    if (!ratio)
      header_error(path, fmt::format("OME: {} is in units of '{}', which cannot be compared with "
                                     "'{}'",
                                     names[axis], printable(unit, 20), printable(*first, 20)));
    description.spacing[axis] = length * *ratio;
  }
}

TiffDescription parse_ome(const std::string& path, std::string_view text) {
  TiffDescription description;
  const std::string_view pixels = text.substr(text.find("<Pixels"));
  const auto count = [&](const char* name) {
    const auto value = attribute(pixels, name);
    return value ? read_count(path, name, *value) : 1;
  };
  description.channels = count("SizeC");
  description.slices = count("SizeZ");
  description.times = count("SizeT");
  // Colours of a pixel are no pages.
  if (const std::size_t at = pixels.find("<Channel"); at != std::string_view::npos)
    if (const auto samples = attribute(pixels.substr(at), "SamplesPerPixel"))
      description.channels =
          std::max<Index>(1, description.channels / read_count(path, "SamplesPerPixel", *samples));
  if (const auto order = attribute(pixels, "DimensionOrder")) {
    description.order = order->starts_with("XY") ? std::string(order->substr(2)) : "";
    for (const char axis : {'C', 'Z', 'T'})
      if (description.order.size() != 3 || description.order.find(axis) == std::string::npos)
        header_error(path, "OME: the DimensionOrder is not known");
  }
  read_physical_size(path, pixels, description);
  return description;
}

}  // namespace

TiffDescription parse_tiff_description(const std::string& path, const std::string& text) {
  if (text.starts_with("ImageJ=")) return parse_image_j(path, text);
  if (text.find("<OME") != std::string::npos && text.find("<Pixels") != std::string::npos)
    return parse_ome(path, text);
  return {};
}

}  // namespace isobrick
