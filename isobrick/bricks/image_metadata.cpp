#include "isobrick/bricks/image_metadata.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>

#include "isobrick/bricks/checked_json.h"
#include "isobrick/bricks/codec.h"
#include "isobrick/core/error.h"

namespace isobrick {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxLevels = 64, kMaxAxes = 5;
constexpr const char* kChecksumKey = "metadata_crc32c";

Json zyx(Vec3d v) { return {v.z, v.y, v.x}; }

// The last three of as many numbers as there are axes.
Vec3d parse_zyx(const CheckedJson& json, std::size_t axes) {
  if (json.array_size() != axes) json.damaged(fmt::format("must have {} numbers", axes));
  return {json.at(axes - 1).number(), json.at(axes - 2).number(), json.at(axes - 3).number()};
}

// world = translation + scale ∘ index, from a list of OME-Zarr's transformations.
struct ScaleAndTranslation {
  Vec3d scale{1, 1, 1}, translation{0, 0, 0};
};

ScaleAndTranslation parse_transformations(const CheckedJson& list, std::size_t axes) {
  ScaleAndTranslation result;
  for (std::size_t i = 0; i < list.array_size(); ++i) {
    const CheckedJson item = list.at(i);
    const std::string type = item.string_at("type");
    if (type == "scale") {
      const Vec3d scale = parse_zyx(item.at("scale"), axes);
      for (int axis = 0; axis < 3; ++axis)
        if (!(scale[axis] > 0)) item.damaged("scale must be positive");
      result.scale = result.scale * scale;
      result.translation = result.translation * scale;
    } else if (type == "translation") {
      result.translation = result.translation + parse_zyx(item.at("translation"), axes);
    } else if (type != "identity") {
      item.unsupported(fmt::format("transformation '{}' is not supported", type));
    }
  }
  return result;
}

ImageMetadata::Axis parse_leading_axis(const CheckedJson& axis) {
  using enum ImageMetadata::Axis::Role;
  ImageMetadata::Axis result{axis.string_at("name"), unknown};
  const std::string type =
      axis.has("type") && axis.raw()["type"].is_string() ? axis.string_at("type") : "";
  if (type == "space")
    axis.unsupported(
        fmt::format("axis '{}' is not supported, only z, y, x in this order", result.name));
  if (type == "time" || result.name == "t") result.role = time;
  if (type == "channel" || result.name == "c") result.role = channel;
  return result;
}

// Returns the unit of z, y, x, which must be the last.
std::string parse_axes(const CheckedJson& axes, ImageMetadata& image) {
  const std::size_t count = axes.array_size();
  if (count < 3 || count > kMaxAxes)
    axes.unsupported(
        fmt::format("images of {} dimensions are not supported, only [t, c,] z, y, x", count));
  for (std::size_t i = 0; i + 3 < count; ++i)
    image.leading.push_back(parse_leading_axis(axes.at(i)));
  std::string unit;
  for (std::size_t i = 0; i < 3; ++i) {
    const CheckedJson axis = axes.at(count - 3 + i);
    const std::string name = axis.string_at("name");
    if (name != std::string(1, "zyx"[i]) || (axis.has("type") && axis.string_at("type") != "space"))
      axis.unsupported(fmt::format("axis '{}' is not supported, only z, y, x in this order", name));
    const std::string own = axis.has("unit") ? axis.string_at("unit") : "";
    if (i == 0)
      unit = own;
    else if (own != unit)
      axis.unsupported("axes with different units are not supported");
  }
  return unit;
}

void check_path(const CheckedJson& json, const std::string& path) {
  // Array paths come from a file: they must not lead out of the store.
  bool bad = path.empty() || path.front() == '/' || path.find('\0') != std::string::npos;
  for (std::size_t begin = 0; begin <= path.size();) {
    const std::size_t end = std::min(path.find('/', begin), path.size());
    bad = bad || path.substr(begin, end - begin) == "..";
    begin = end + 1;
  }
  if (bad) json.damaged(fmt::format("'{}' is no path inside the store", path));
}

void parse_multiscales(const CheckedJson& multiscales, ImageMetadata& image) {
  if (multiscales.array_size() == 0) multiscales.damaged("is empty");
  const CheckedJson first = multiscales.at(std::size_t{0});
  if (first.has("name") && first.raw()["name"].is_string()) image.name = first.string_at("name");
  if (first.has("type") && first.raw()["type"].is_string())
    image.downsampling = first.string_at("type");
  const std::string unit = parse_axes(first.at("axes"), image);
  const std::size_t axes = image.leading.size() + 3;
  ScaleAndTranslation common;
  if (first.has("coordinateTransformations"))
    common = parse_transformations(first.at("coordinateTransformations"), axes);
  const CheckedJson datasets = first.at("datasets");
  const std::size_t count = datasets.array_size();
  if (count == 0 || count > kMaxLevels) datasets.damaged(fmt::format("{} levels", count));
  for (std::size_t i = 0; i < count; ++i) {
    const CheckedJson dataset = datasets.at(i);
    ImageMetadata::Level level;
    level.path = dataset.string_at("path");
    check_path(dataset, level.path);
    const auto own = parse_transformations(dataset.at("coordinateTransformations"), axes);
    level.transform.spacing = common.scale * own.scale;
    level.transform.origin = common.scale * own.translation + common.translation;
    level.transform.unit = unit;
    for (int axis = 0; axis < 3; ++axis)
      if (!(level.transform.spacing[axis] > 0) || !std::isfinite(level.transform.spacing[axis]) ||
          !std::isfinite(level.transform.origin[axis]))
        dataset.damaged("scale must be finite and positive, translation finite");
    image.levels.push_back(std::move(level));
  }
}

void parse_ours(const CheckedJson& ours, ImageMetadata& image) {
  if (const Index version = ours.at("version").integer(); version != kStoreVersion)
    ours.unsupported(fmt::format(
        "store version {} is not known to this program, which knows {}; use a newer one", version,
        kStoreVersion));
  if (ours.has("may_have_nan")) image.may_have_nan = ours.at("may_have_nan").boolean();
  if (ours.has("grid_class")) image.grid_class = ours.string_at("grid_class");
  if (ours.has("grid_name")) image.grid_name = ours.string_at("grid_name");
  if (ours.has("direction")) {
    const CheckedJson direction = ours.at("direction");
    if (direction.array_size() != 9) direction.damaged("must have 9 numbers");
    std::array<double, 9> values{};
    for (std::size_t i = 0; i < 9; ++i) values[i] = direction.at(i).number();
    if (!is_orthonormal(values)) direction.damaged("must be orthonormal");
    for (ImageMetadata::Level& level : image.levels) level.transform.direction = values;
  }
  if (!ours.has(kChecksumKey)) return;
  const CheckedJson checksum = ours.at(kChecksumKey);
  const Index value = checksum.integer();
  if (value < 0 || value > Index{0xffffffff}) checksum.damaged("is no checksum");
  image.checksum = static_cast<std::uint32_t>(value);
}

// Numbers as the bits of a double, so that nothing depends on how a program
// writes them: 2, 2.0 and 2e0 are the same.
void replace_numbers(nlohmann::json& json) {
  if (json.is_number())
    json = fmt::format("{:016x}", std::bit_cast<std::uint64_t>(json.get<double>()));
  else if (json.is_structured())
    for (nlohmann::json& element : json) replace_numbers(element);
}

}  // namespace

std::string to_json(const ImageMetadata& image) {
  const Transform& finest = image.levels.at(0).transform;
  Json axes = Json::array();
  for (const char* name : {"z", "y", "x"}) {
    Json axis = {{"name", name}, {"type", "space"}};
    if (!finest.unit.empty()) axis["unit"] = finest.unit;
    axes.push_back(std::move(axis));
  }
  Json datasets = Json::array();
  for (const ImageMetadata::Level& level : image.levels) {
    Json dataset;
    dataset["path"] = level.path;
    dataset["coordinateTransformations"] = Json::array();
    dataset["coordinateTransformations"].push_back(
        {{"type", "scale"}, {"scale", zyx(level.transform.spacing)}});
    dataset["coordinateTransformations"].push_back(
        {{"type", "translation"}, {"translation", zyx(level.transform.origin)}});
    datasets.push_back(std::move(dataset));
  }
  Json multiscale;
  multiscale["name"] = image.name;
  if (!image.downsampling.empty()) multiscale["type"] = image.downsampling;
  multiscale["axes"] = std::move(axes);
  multiscale["datasets"] = std::move(datasets);

  Json ours;
  ours["version"] = kStoreVersion;
  if (!finest.axis_aligned()) ours["direction"] = finest.direction;
  if (!image.grid_class.empty()) ours["grid_class"] = image.grid_class;
  if (!image.grid_name.empty()) ours["grid_name"] = image.grid_name;
  if (image.may_have_nan) ours["may_have_nan"] = *image.may_have_nan;
  if (image.checksum) ours[kChecksumKey] = *image.checksum;

  Json attributes;
  attributes["ome"]["version"] = "0.5";
  attributes["ome"]["multiscales"] = Json::array({std::move(multiscale)});
  if (image.ours) attributes["isobrick"] = std::move(ours);
  Json json;
  json["zarr_format"] = 3;
  json["node_type"] = "group";
  json["attributes"] = std::move(attributes);
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

ImageMetadata parse_image_metadata(std::string_view text, const std::string& where) {
  const nlohmann::json parsed = parse_json(text, where);
  const CheckedJson json(parsed, where);
  if (json.at("zarr_format").integer() != 3) json.unsupported("only Zarr version 3 is supported");
  if (json.string_at("node_type") != "group")
    json.unsupported("is an array; only OME-Zarr images (groups) are supported");
  const CheckedJson attributes = json.at("attributes");
  if (!attributes.has("ome"))
    json.unsupported(
        "is no OME-Zarr 0.5 image: attributes.ome is missing; an image or an array in it can be "
        "named");
  const CheckedJson ome = attributes.at("ome");
  if (const std::string version = ome.string_at("version"); version != "0.5")
    ome.unsupported(fmt::format("OME-Zarr {} is not supported, only 0.5", version));
  if (!ome.has("multiscales")) ome.unsupported("is no multiscale image");

  ImageMetadata image;
  parse_multiscales(ome.at("multiscales"), image);
  image.ours = attributes.has("isobrick");
  if (image.ours) parse_ours(attributes.at("isobrick"), image);
  return image;
}

std::uint32_t metadata_checksum(std::string_view root, std::span<const std::string> levels,
                                const std::string& where) {
  const nlohmann::json parsed = parse_json(root, where);
  const CheckedJson attributes = CheckedJson(parsed, where).at("attributes");
  nlohmann::json covered;
  // Other programs may add to the rest of `ome` how they show the image.
  covered["multiscales"] = attributes.at("ome").at("multiscales").raw();
  if (attributes.has("isobrick")) covered["isobrick"] = attributes.at("isobrick").raw();
  if (attributes.has("isobrick") && covered["isobrick"].is_object())
    covered["isobrick"].erase(kChecksumKey);
  covered["levels"] = nlohmann::json::array();
  for (std::size_t i = 0; i < levels.size(); ++i) {
    nlohmann::json level = parse_json(levels[i], fmt::format("{}: level {}", where, i));
    if (level.is_object()) level.erase("attributes");
    covered["levels"].push_back(std::move(level));
  }
  replace_numbers(covered);
  const std::string text = covered.dump();  // sorted by key, without blanks
  return crc32c(std::as_bytes(std::span(text)));
}

bool is_orthonormal(const std::array<double, 9>& direction) {
  constexpr double tolerance = 1e-4;
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = a; b < 3; ++b) {
      double product = 0;
      for (std::size_t row = 0; row < 3; ++row)
        product += direction[3 * row + a] * direction[3 * row + b];
      if (!(std::abs(product - (a == b ? 1 : 0)) <= tolerance)) return false;
    }
  return true;
}

}  // namespace isobrick
