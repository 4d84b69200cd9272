#include <isobrick/image_metadata.h>

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <set>

#include <isobrick/error.h>
#include "bricks/zarr/codec.h"
#include "bricks/zarr/json_reader.h"
#include "bricks/zarr/label_metadata.h"
#include "bricks/zarr/ome_transformations.h"

namespace isobrick::inline v0 {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxLevels = 64, kMaxAxes = 5;
constexpr const char* kChecksumKey = "metadata_crc32c";

Json zyx(Vec3d v) { return {v.z, v.y, v.x}; }

ImageMetadata::Axis parse_leading_axis(const JsonReader& axis) {
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
std::string parse_axes(const JsonReader& axes, ImageMetadata& image) {
  const std::size_t count = axes.array_size();
  if (count < 3 || count > kMaxAxes)
    axes.unsupported(
        fmt::format("images of {} dimensions are not supported, only [t, c,] z, y, x", count));
  for (std::size_t i = 0; i + 3 < count; ++i)
    image.leading.push_back(parse_leading_axis(axes.at(i)));
  std::string unit;
  for (std::size_t i = 0; i < 3; ++i) {
    const JsonReader axis = axes.at(count - 3 + i);
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

void check_path(const JsonReader& json, const std::string& path) {
  // Array paths come from a file: they must not lead out of the store.
  bool bad = path.empty() || path.front() == '/' || path.find('\0') != std::string::npos;
  for (std::size_t begin = 0; begin <= path.size();) {
    const std::size_t end = std::min(path.find('/', begin), path.size());
    bad = bad || path.substr(begin, end - begin) == "..";
    begin = end + 1;
  }
  if (bad) json.damaged(fmt::format("'{}' is no path inside the store", path));
}

void add_level(const JsonReader& dataset, const AffineMap& map, const std::string& unit,
               ImageMetadata& image) {
  ImageMetadata::Level level;
  level.path = dataset.string_at("path");
  check_path(dataset, level.path);
  level.transform = to_transform(dataset, map);
  level.transform.unit = unit;
  image.levels.push_back(std::move(level));
}

JsonReader datasets_of(const JsonReader& multiscale) {
  const JsonReader datasets = multiscale.at("datasets");
  const std::size_t count = datasets.array_size();
  if (count == 0 || count > kMaxLevels) datasets.damaged(fmt::format("{} levels", count));
  return datasets;
}

// OME-Zarr 0.4 and 0.5: one coordinate system, transformations in lists.
void parse_levels(const JsonReader& multiscale, ImageMetadata& image) {
  const std::string unit = parse_axes(multiscale.at("axes"), image);
  const std::size_t axes = image.leading.size() + 3;
  AffineMap common;
  if (multiscale.has("coordinateTransformations"))
    common = parse_scale_and_translation(multiscale.at("coordinateTransformations"), axes);
  const JsonReader datasets = datasets_of(multiscale);
  for (std::size_t i = 0; i < datasets.array_size(); ++i) {
    const JsonReader dataset = datasets.at(i);
    const AffineMap own =
        parse_scale_and_translation(dataset.at("coordinateTransformations"), axes);
    add_level(dataset, then(own, common), unit, image);
  }
}

// The axes of the coordinate system of this name.
JsonReader axes_of(const JsonReader& multiscale, const std::string& name) {
  const JsonReader systems = multiscale.at("coordinateSystems");
  for (std::size_t i = 0; i < systems.array_size(); ++i)
    if (systems.at(i).string_at("name") == name) return systems.at(i).at("axes");
  systems.damaged(fmt::format("has no '{}'", name));
}

// The only transformation of a whole image that begins at the system; several leave open which.
std::optional<JsonReader> only_one_from(const JsonReader& multiscale, const std::string& system) {
  std::optional<JsonReader> found;
  if (!multiscale.has("coordinateTransformations")) return found;
  const JsonReader list = multiscale.at("coordinateTransformations");
  for (std::size_t i = 0; i < list.array_size(); ++i) {
    if (coordinate_system(list.at(i).at("input")) != system) continue;
    if (found) return std::nullopt;
    found.emplace(list.at(i));
  }
  return found;
}

// OME-Zarr 0.6: levels are placed in the intrinsic system; what leads on from there to one
// other system is followed.
void parse_levels_06(const JsonReader& multiscale, ImageMetadata& image) {
  const JsonReader datasets = datasets_of(multiscale);
  const auto own_of = [&](std::size_t i) {
    const JsonReader list = datasets.at(i).at("coordinateTransformations");
    if (list.array_size() != 1)
      list.damaged(fmt::format("must have one transformation, has {}", list.array_size()));
    return list.at(std::size_t{0});
  };
  const std::string intrinsic = coordinate_system(own_of(0).at("output"));
  std::string unit = parse_axes(axes_of(multiscale, intrinsic), image);
  const std::size_t axes = image.leading.size() + 3;
  AffineMap common;
  std::set<std::string> visited;
  for (std::string system = intrinsic; visited.insert(system).second;) {
    const auto next = only_one_from(multiscale, system);
    if (!next) break;
    common = then(common, parse_transformation(*next, axes));
    system = coordinate_system(next->at("output"));
    ImageMetadata reached;
    unit = parse_axes(axes_of(multiscale, system), reached);
    if (reached.leading != image.leading)
      next->unsupported("a transformation to other axes is not supported");
  }
  for (std::size_t i = 0; i < datasets.array_size(); ++i) {
    const JsonReader own = own_of(i);
    if (coordinate_system(own.at("output")) != intrinsic)
      own.damaged(fmt::format("must lead to '{}', as that of the first level", intrinsic));
    add_level(datasets.at(i), then(parse_transformation(own, axes), common), unit, image);
  }
}

// Its drafts and release candidates had names such as "0.6.dev4" and "0.6rc1".
bool is_06(std::string_view version) {
  return version.starts_with("0.6") &&
         (version.size() == 3 || version[3] < '0' || version[3] > '9');
}

void parse_multiscales(const JsonReader& multiscales, bool version_06, ImageMetadata& image) {
  if (multiscales.array_size() == 0) multiscales.damaged("is empty");
  const JsonReader first = multiscales.at(std::size_t{0});
  if (first.has("name") && first.raw()["name"].is_string()) image.name = first.string_at("name");
  if (first.has("type") && first.raw()["type"].is_string())
    image.downsampling = first.string_at("type");
  version_06 ? parse_levels_06(first, image) : parse_levels(first, image);
}

// How an image is shown is no part of the specification proper: what is not there is left out.
void parse_channel_names(const nlohmann::json& ome, ImageMetadata& image) {
  const nlohmann::json omero = ome.value("omero", nlohmann::json::object());
  if (!omero.is_object() || !omero.contains("channels") || !omero["channels"].is_array()) return;
  for (const nlohmann::json& channel : omero["channels"]) {
    const bool has_label =
        channel.is_object() && channel.contains("label") && channel["label"].is_string();
    image.channel_names.push_back(has_label ? channel["label"].get<std::string>() : "");
  }
}

void parse_ours(const JsonReader& ours, ImageMetadata& image) {
  ours.at("version").check_version("store", kStoreVersion, "convert the volume anew");
  if (ours.has("may_have_nan")) image.may_have_nan = ours.at("may_have_nan").boolean();
  if (ours.has("grid_class")) image.grid_class = ours.string_at("grid_class");
  if (ours.has("grid_name")) image.grid_name = ours.string_at("grid_name");
  if (ours.has("direction")) {
    const JsonReader direction = ours.at("direction");
    if (direction.array_size() != 9) direction.damaged("must have 9 numbers");
    std::array<double, 9> values{};
    for (std::size_t i = 0; i < 9; ++i) values[i] = direction.at(i).number();
    if (!is_orthonormal(values)) direction.damaged("must be orthonormal");
    for (ImageMetadata::Level& level : image.levels) level.transform.direction = values;
  }
  if (!ours.has(kChecksumKey)) return;
  const JsonReader checksum = ours.at(kChecksumKey);
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

// How viewers show the image at first: white, within the window.
Json omero(const ImageMetadata& image) {
  const DisplayWindow& w = *image.window;
  const Json channel{
      {"label", image.name},
      {"active", true},
      {"color", "FFFFFF"},
      {"window", {{"min", w.min}, {"max", w.max}, {"start", w.start}, {"end", w.end}}}};
  return {{"channels", Json::array({channel})}, {"rdefs", {{"model", "greyscale"}}}};
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
    Json dataset = Json::object();
    dataset["path"] = level.path;
    dataset["coordinateTransformations"] = Json::array();
    dataset["coordinateTransformations"].push_back(
        {{"type", "scale"}, {"scale", zyx(level.transform.spacing)}});
    dataset["coordinateTransformations"].push_back(
        {{"type", "translation"}, {"translation", zyx(level.transform.origin)}});
    datasets.push_back(std::move(dataset));
  }
  Json multiscale = Json::object();
  multiscale["name"] = image.name;
  if (!image.downsampling.empty()) multiscale["type"] = image.downsampling;
  multiscale["axes"] = std::move(axes);
  multiscale["datasets"] = std::move(datasets);

  Json ours = Json::object();
  ours["version"] = kStoreVersion;
  if (!finest.axis_aligned()) ours["direction"] = finest.direction;
  if (!image.grid_class.empty()) ours["grid_class"] = image.grid_class;
  if (!image.grid_name.empty()) ours["grid_name"] = image.grid_name;
  if (image.may_have_nan) ours["may_have_nan"] = *image.may_have_nan;
  if (image.checksum) ours[kChecksumKey] = *image.checksum;

  Json attributes = Json::object();
  attributes["ome"] = Json::object();
  attributes["ome"]["version"] = "0.5";
  attributes["ome"]["multiscales"] = Json::array({std::move(multiscale)});
  if (image.window) attributes["ome"]["omero"] = omero(image);
  if (image.labels) attributes["ome"]["image-label"] = image_label_json(*image.labels);
  if (image.ours) attributes["isobrick"] = std::move(ours);
  Json json = Json::object();
  json["zarr_format"] = 3;
  json["node_type"] = "group";
  json["attributes"] = std::move(attributes);
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

ImageMetadata parse_image_metadata(std::string_view text, const std::string& where) {
  const nlohmann::json parsed = parse_json(text, where);
  const JsonReader json(parsed, where);
  if (json.at("zarr_format").integer() != 3) json.unsupported("only Zarr version 3 is supported");
  if (json.string_at("node_type") != "group")
    json.unsupported("is an array; only OME-Zarr images (groups) are supported");
  const JsonReader attributes = json.at("attributes");
  if (!attributes.has("ome"))
    json.unsupported(
        "is no OME-Zarr image: attributes.ome is missing; an image or an array in it can be "
        "named");
  const JsonReader ome = attributes.at("ome");
  const std::string version = ome.string_at("version");
  if (version != "0.5" && !is_06(version))
    ome.unsupported(fmt::format("OME-Zarr {} is not supported, only 0.4 to 0.6", version));
  if (!ome.has("multiscales")) ome.unsupported("is no multiscale image");

  ImageMetadata image;
  parse_multiscales(ome.at("multiscales"), is_06(version), image);
  if (!image.leading.empty()) parse_channel_names(ome.raw(), image);
  if (ome.has("image-label")) image.labels = parse_image_label(ome.at("image-label"));
  image.ours = attributes.has("isobrick");
  if (image.ours) parse_ours(attributes.at("isobrick"), image);
  return image;
}

std::uint32_t metadata_checksum(std::string_view root, std::span<const std::string> levels,
                                const std::string& where) {
  const nlohmann::json parsed = parse_json(root, where);
  const JsonReader attributes = JsonReader(parsed, where).at("attributes");
  nlohmann::json covered = nlohmann::json::object();
  // Other programs may change in the rest of `ome` how they show the image, or names of labels.
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

}  // namespace isobrick
