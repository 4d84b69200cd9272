#include "pipeline/labels/label_piece_format.h"

#include <fmt/format.h>

#include <isobrick/error.h>
#include "bricks/zarr/label_json.h"
#include "pipeline/extract/mesh_header.h"
#include "pipeline/labels/label_plan.h"
#include "pipeline/pieces/piece_identity.h"

namespace isobrick::inline v0 {
namespace {

using nlohmann::json;

json labels_json(const LabelSelection& labels) {
  json list = json::array();
  for (const LabelRange& range : labels.ranges()) list.push_back({range.first, range.last});
  return list;
}

json properties_json(const std::optional<LabelTable>& labels) {
  if (!labels) return nullptr;
  json list = json::array();
  for (const LabelProperties& of_label : *labels)
    list.push_back(
        {of_label.label, of_label.name, of_label.colour ? json(*of_label.colour) : json(nullptr)});
  return list;
}

LabelProperties properties_of(const json& entry) {
  LabelProperties properties{.label = entry.at(0).get<Label>(),
                             .name = entry.at(1).get<std::string>()};
  if (!entry.at(2).is_null()) properties.colour = entry.at(2).get<std::array<std::uint8_t, 4>>();
  return properties;
}

}  // namespace

json label_mesh_json(const StoreReader& store, const LabelOptions& options,
                     const LabelImage& image) {
  const bool smooths = image.smoothing.iterations > 0;
  return {{"isobrick", version_text()},
          {"samples", samples_json(store, options.level)},
          {"labels", labels_json(image.labels)},
          {"background", options.background},
          {"smooth", image.smoothing.iterations},
          {"pass_band", smooths ? image.smoothing.pass_band : LabelOptions{}.pass_band},
          {"region", box_json(image.roi)},
          {"transform", transform_json(image.transform)},
          {"properties", properties_json(store.info().labels)}};
}

int LabelPieceDescription::level() const { return mesh.at("samples").at("level").get<int>(); }

LabelImage LabelPieceDescription::image() const {
  std::vector<LabelRange> ranges;
  for (const json& range : mesh.at("labels"))
    ranges.push_back({range.at(0).get<Label>(), range.at(1).get<Label>()});
  const auto type = parse_scalar_type(mesh.at("samples").at("type").get<std::string>());
  if (!type) throw Error("the piece has samples of an unknown type");
  LabelImage image{.name = fmt::format("'{}'", name),
                   .extent = extent(),
                   .type = *type,
                   .transform = transform_of(mesh.at("transform")),
                   .roi = box_of(mesh.at("region")),
                   .labels = {std::move(ranges), mesh.at("background").get<Label>()}};
  image.smoothing = label_smoothing(
      {.smooth = mesh.at("smooth").get<int>(), .pass_band = mesh.at("pass_band").get<double>()});
  check_roi(image.roi, image.extent);
  return image;
}

std::optional<LabelTable> LabelPieceDescription::properties() const {
  const json& list = mesh.at("properties");
  if (list.is_null()) return std::nullopt;
  LabelTable table;
  for (const json& entry : list) table.push_back(properties_of(entry));
  return table;
}

std::string to_text(const LabelPieceDescription& description) {
  json object = to_json(description);
  object["name"] = description.name;
  return object.dump();
}

std::optional<LabelPieceDescription> parse_label_description(std::string_view text) try {
  const json object = json::parse(text);
  LabelPieceDescription description{piece_key_of(object), object.at("name").get<std::string>()};
  description.level();
  description.image();
  description.properties();
  return description;
} catch (const json::exception&) {
  return std::nullopt;
} catch (const Error&) {
  return std::nullopt;
}

}  // namespace isobrick
