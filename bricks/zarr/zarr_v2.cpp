#include "bricks/zarr/zarr_v2.h"

#include <fmt/format.h>

#include <isobrick/scalar.h>
#include "bricks/zarr/json_reader.h"
#include "core/wide_type.h"

namespace isobrick::inline v0 {
namespace {

using Json = nlohmann::ordered_json;

struct NumpyType {
  std::string name;  ///< as Zarr version 3 has it
  bool big_endian = false;
};

/// "<u2", "|i1", ">f4".
NumpyType parse_dtype(const JsonReader& json) {
  if (!json.raw().is_string()) json.unsupported("structured data types are not supported");
  const std::string text = json.string();
  const auto refuse = [&]() {
    json.unsupported(fmt::format("data type '{}' is not supported", text));
  };
  if (text.size() != 3 || std::string_view("<>|").find(text[0]) == std::string_view::npos) refuse();
  const int bytes = text[2] - '0';
  for (const auto& [kind, type] : {std::pair("f2", WideType::f16), {"b1", WideType::boolean}})
    if (text.substr(1) == kind) return {std::string(zarr_name(type)), text[0] == '>'};
  for (const ScalarType type : kScalarTypes) {
    const char kind = short_name(type)[0];
    if (kind == text[1] && static_cast<int>(size_of(type)) == bytes)
      return {std::string(zarr_name(type)), text[0] == '>'};
  }
  refuse();
  return {};
}

Json codecs_of(const JsonReader& json, bool big_endian) {
  Json codecs = Json::array();
  codecs.push_back(
      {{"name", "bytes"}, {"configuration", {{"endian", big_endian ? "big" : "little"}}}});
  if (json.has("filters") && !json.raw()["filters"].is_null() &&
      json.at("filters").array_size() > 0)
    json.at("filters").unsupported(fmt::format(
        "filter '{}' is not supported", json.at("filters").at(std::size_t{0}).string_at("id")));
  if (!json.has("compressor") || json.raw()["compressor"].is_null()) return codecs;
  const JsonReader compressor = json.at("compressor");
  Json codec{{"name", compressor.string_at("id")}};
  if (compressor.has("level"))
    codec["configuration"] = {{"level", compressor.at("level").integer()}};
  codecs.push_back(std::move(codec));
  return codecs;
}

}  // namespace

std::string v3_from_zarray(std::string_view text, const std::string& where) {
  const nlohmann::json parsed = parse_json(text, where);
  const JsonReader json(parsed, where);
  if (json.at("zarr_format").integer() != 2) json.damaged("zarr_format must be 2");
  if (const std::string order = json.string_at("order"); order != "C")
    json.unsupported(fmt::format("order '{}' is not supported, only C", order));
  const NumpyType type = parse_dtype(json.at("dtype"));
  const std::string separator =
      json.has("dimension_separator") ? json.string_at("dimension_separator") : ".";
  Json array = Json::object();
  array["zarr_format"] = 3;
  array["node_type"] = "array";
  array["shape"] = json.at("shape").raw();
  array["data_type"] = type.name;
  array["chunk_grid"] = {{"name", "regular"},
                         {"configuration", {{"chunk_shape", json.at("chunks").raw()}}}};
  array["chunk_key_encoding"] = {{"name", "v2"}, {"configuration", {{"separator", separator}}}};
  const JsonReader fill = json.at("fill_value");
  // Null leaves open what an absent chunk holds; zero is what others show.
  array["fill_value"] = fill.raw().is_null() ? nlohmann::json(0) : fill.raw();
  array["codecs"] = codecs_of(json, type.big_endian);
  return array.dump();
}

std::string v3_from_zattrs(std::string_view text, const std::string& where) {
  const nlohmann::json parsed = parse_json(text, where);
  const JsonReader json(parsed, where);
  if (!json.has("multiscales")) return {};
  const JsonReader multiscales = json.at("multiscales");
  if (multiscales.array_size() == 0) multiscales.damaged("is empty");
  const JsonReader first = multiscales.at(std::size_t{0});
  const std::string version = first.has("version") ? first.string_at("version") : "unknown";
  if (version != "0.4")
    first.unsupported(fmt::format("OME-NGFF {} is not supported, only 0.4 to 0.6", version));
  Json group = Json::object();
  group["zarr_format"] = 3;
  group["node_type"] = "group";
  group["attributes"] = {{"ome", {{"version", "0.5"}, {"multiscales", multiscales.raw()}}}};
  if (json.has("isobrick")) group["attributes"]["isobrick"] = json.at("isobrick").raw();
  if (json.has("omero")) group["attributes"]["ome"]["omero"] = json.at("omero").raw();
  if (json.has("image-label"))
    group["attributes"]["ome"]["image-label"] = json.at("image-label").raw();
  return group.dump();
}

std::string to_zarray(const ArrayMetadata& array) {
  // The fill value and the names of codecs are those of version 3.
  const Json v3 = Json::parse(to_json(array));
  Json json = Json::object();
  json["zarr_format"] = 2;
  json["shape"] = v3["shape"];
  json["chunks"] = v3["chunk_grid"]["configuration"]["chunk_shape"];
  json["dtype"] = fmt::format("{}{}{}", size_of(array.type) == 1 ? '|' : '<',
                              short_name(array.type)[0], size_of(array.type));
  json["compressor"] = nullptr;
  for (const ByteCodec step : array.codecs.steps)
    json["compressor"] = {{"id", name_of(step)}, {"level", array.codecs.zstd_level}};
  json["fill_value"] = v3["fill_value"];
  json["order"] = "C";
  json["filters"] = nullptr;
  json["dimension_separator"] = std::string(1, array.separator);
  return json.dump(2) + "\n";
}

std::string to_zattrs(const ImageMetadata& image) {
  Json attributes = Json::parse(to_json(image))["attributes"];
  Json json = Json::object();
  json["multiscales"] = Json::array();
  for (const Json& multiscale : attributes["ome"]["multiscales"]) {
    Json item{{"version", "0.4"}};
    item.update(multiscale);
    json["multiscales"].push_back(std::move(item));
  }
  if (attributes["ome"].contains("omero")) {
    json["omero"] = attributes["ome"]["omero"];
    json["omero"]["version"] = "0.4";
  }
  if (attributes["ome"].contains("image-label")) {
    json["image-label"] = attributes["ome"]["image-label"];
    json["image-label"]["version"] = "0.4";
  }
  if (attributes.contains("isobrick")) json["isobrick"] = attributes["isobrick"];
  return json.dump(2) + "\n";
}

std::string zgroup_json() { return Json{{"zarr_format", 2}}.dump(2) + "\n"; }

}  // namespace isobrick
