#include "bricks/zarr/label_metadata.h"

#include <algorithm>
#include <map>
#include <optional>

#include <isobrick/sample_value.h>
#include "bricks/storage/storage_keys.h"
#include "bricks/zarr/label_json.h"

namespace isobrick::inline v0 {
namespace {

using Json = nlohmann::ordered_json;

/// The label that an entry of `colors` or `properties` is of.
std::optional<Label> label_of(const JsonReader& entry) {
  if (!entry.has("label-value")) return std::nullopt;
  const JsonReader json = entry.at("label-value");
  if (json.raw().is_number_integer()) return json.raw().get<Label>();
  const SampleValue number = json.number();
  if (const auto integer = number.as_signed()) return *integer;
  if (const auto integer = number.as_unsigned()) return *integer;
  return std::nullopt;
}

/// Calls f(entry, label) for each entry of a list that may be missing.
template <class F>
void for_each_entry(const JsonReader& image_label, const char* list, const F& f) {
  if (!image_label.has(list)) return;
  const JsonReader entries = image_label.at(list);
  for (std::size_t i = 0; i < entries.array_size(); ++i) {
    const JsonReader entry = entries.at(i);
    if (const auto label = label_of(entry)) f(entry, *label);
  }
}

/// What its properties call a label: `name`, else `label-name`, else the first text of any key,
/// which is what segmentation programs that have no such key put there ("class").
std::string name_in(const JsonReader& properties) {
  for (const char* key : {"name", "label-name"})
    if (properties.has(key) && properties.raw()[key].is_string()) return properties.string_at(key);
  for (const auto& [key, value] : properties.raw().items())
    if (value.is_string()) return value.get<std::string>();
  return {};
}

std::optional<std::array<std::uint8_t, 4>> parse_rgba(const JsonReader& entry) {
  if (!entry.has("rgba")) return std::nullopt;
  const JsonReader rgba = entry.at("rgba");
  if (rgba.array_size() != 4) rgba.damaged("must have 4 numbers");
  std::array<std::uint8_t, 4> colour{};
  for (std::size_t i = 0; i < 4; ++i) {
    const double value = rgba.at(i).number();
    if (!(value >= 0 && value <= 255)) rgba.damaged("must be numbers from 0 to 255");
    colour[i] = static_cast<std::uint8_t>(value);
  }
  return colour;
}

/// The names in the metadata of a group `labels`.
std::vector<std::string> names_in(const JsonReader& labels) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < labels.array_size(); ++i) names.push_back(labels.at(i).string());
  return names;
}

}  // namespace

LabelTable parse_image_label(const JsonReader& image_label) {
  std::map<Label, LabelProperties> by_label;
  for_each_entry(image_label, "colors", [&](const JsonReader& entry, const Label& label) {
    by_label[label].colour = parse_rgba(entry);
  });
  for_each_entry(image_label, "properties", [&](const JsonReader& entry, const Label& label) {
    by_label[label].name = name_in(entry);
  });
  LabelTable table;
  for (auto& [label, properties] : by_label) {
    properties.label = label;
    table.push_back(std::move(properties));
  }
  return table;
}

Json image_label_json(const LabelTable& labels) {
  Json colours = Json::array(), names = Json::array();
  if (labels.size() <= kMaxDescribedLabels)
    for (const LabelProperties& l : labels) {
      if (l.colour) colours.push_back({{"label-value", l.label}, {"rgba", *l.colour}});
      if (!l.name.empty()) names.push_back({{"label-value", l.label}, {"name", l.name}});
    }
  Json json = Json::object();
  json["version"] = "0.5";
  if (!colours.empty()) json["colors"] = std::move(colours);
  if (!names.empty()) json["properties"] = std::move(names);
  return json;
}

std::vector<std::string> label_image_names(const Storage& storage) {
  const auto read = [&](const char* key) {
    return read_small_object(storage, key, kMaxMetadataBytes);
  };
  if (const auto v3 = read("labels/zarr.json")) {
    const std::string where = quoted(storage, "labels/zarr.json");
    const nlohmann::json parsed = parse_json(*v3, where);
    const JsonReader group(parsed, where);
    if (!group.has("attributes") || !group.at("attributes").has("ome")) return {};
    const JsonReader ome = group.at("attributes").at("ome");
    return ome.has("labels") ? names_in(ome.at("labels")) : std::vector<std::string>{};
  }
  if (const auto v2 = read("labels/.zattrs")) {
    const std::string where = quoted(storage, "labels/.zattrs");
    const nlohmann::json parsed = parse_json(*v2, where);
    const JsonReader group(parsed, where);
    return group.has("labels") ? names_in(group.at("labels")) : std::vector<std::string>{};
  }
  return {};
}

}  // namespace isobrick
