#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include <isobrick/image_metadata.h>
#include "bricks/zarr/label_metadata.h"
#include "bricks/zarr/zarr_v2.h"
#include "tests/bricks/store_fixture.h"

// `image-label`, by which OME-Zarr marks label images.
namespace isobrick::test {
namespace {

using nlohmann::json;

/// As ome-zarr-py and napari write it.
constexpr const char* kTheirs = R"({
  "version": "0.4", "source": {"image": "../../"},
  "colors": [{"label-value": 7, "rgba": [255, 128, 0, 100]}, {"label-value": 0, "rgba": [0, 0, 0, 0]},
             {"label-value": 12}, {"rgba": [1, 2, 3, 4]}, {"label-value": 1.5, "rgba": [1, 2, 3, 4]}],
  "properties": [{"label-value": 9, "area": 1104, "class": "nucleus", "zone": "z"},
                 {"label-value": 7, "class": "b", "label-name": "c", "name": "Großhirn"},
                 {"label-value": 8, "class": "b", "label-name": "c"},
                 {"label-value": 10, "name": 3, "area": 4}, {"name": "nobody's"}]})";

LabelTable parse(const std::string& text) {
  const json parsed = json::parse(text);
  return parse_image_label(JsonReader(parsed, "file"));
}

LabelTable theirs() {
  return {{0, "", {{0, 0, 0, 0}}},
          {7, "Großhirn", {{255, 128, 0, 100}}},
          {8, "c", {}},
          {9, "nucleus", {}},
          {10, "", {}},
          {12, "", {}}};
}

/// Metadata of both versions, as parse_image_metadata() takes them.
std::string image_of_others(int version, const json& image_label) {
  json scale{{"axes", json::array()}};
  for (const char* name : {"z", "y", "x"})
    scale["axes"].push_back({{"name", name}, {"type", "space"}});
  json transformation{{"type", "scale"}, {"scale", {1, 1, 1}}};
  scale["datasets"] = {{{"path", "0"}, {"coordinateTransformations", {transformation}}}};
  if (version == 2) {
    scale["version"] = "0.4";
    return v3_from_zattrs(json{{"multiscales", {scale}}, {"image-label", image_label}}.dump(),
                          "file");
  }
  const json ome{{"version", "0.5"}, {"multiscales", {scale}}, {"image-label", image_label}};
  return json{{"zarr_format", 3}, {"node_type", "group"}, {"attributes", {{"ome", ome}}}}.dump();
}

TEST(LabelMetadata, NamesAndColoursOfOthers) {
  EXPECT_EQ(parse(kTheirs), theirs());
  for (const int version : {2, 3})
    EXPECT_EQ(parse_image_metadata(image_of_others(version, json::parse(kTheirs)), "file").labels,
              theirs());
}

TEST(LabelMetadata, PartsMayBeMissing) {
  for (const char* text : {"{}", R"({"version": "0.5"})", R"({"colors": [], "properties": []})",
                           R"({"colors": [{}], "properties": [{}]})"})
    EXPECT_EQ(parse(text), LabelTable{}) << text;
  const std::string plain = image_of_others(3, json::object());
  EXPECT_EQ(parse_image_metadata(plain, "file").labels, LabelTable{});
  json without = json::parse(plain);
  without["attributes"]["ome"].erase("image-label");
  EXPECT_EQ(parse_image_metadata(without.dump(), "file").labels, std::nullopt);
}

TEST(LabelMetadata, WhatIsBrokenIsNamed) {
  for (const char* text :
       {R"({"colors": 3})", R"({"colors": [{"label-value": "7", "rgba": [1, 2, 3, 4]}]})",
        R"({"colors": [{"label-value": 7, "rgba": [1, 2, 3]}]})",
        R"({"colors": [{"label-value": 7, "rgba": [1, 2, 3, 256]}]})",
        R"({"colors": [{"label-value": 7, "rgba": [1, 2, 3, -1]}]})",
        R"({"colors": [{"label-value": 7, "rgba": [1, 2, 3, null]}]})",
        R"({"colors": [{"label-value": 7, "rgba": "red"}]})", R"({"properties": {"7": "a"}})",
        R"({"properties": [{"label-value": null, "name": "a"}]})"}) {
    try {
      parse(text);
      ADD_FAILURE() << "accepted: " << text;
    } catch (const DamageError& error) {
      EXPECT_TRUE(std::string(error.what()).starts_with("file")) << error.what();
    }
  }
  EXPECT_EQ(
      parse(R"({"colors": [{"label-value": 1e300, "rgba": [1, 2, 3, 4]}], "properties": [7]})"),
      LabelTable{});
}

TEST(LabelMetadata, RoundTripOfBothVersions) {
  ImageMetadata image;
  image.levels = {{"0", {}}};
  image.labels = LabelTable{{-3, "a \"b\"", {}},
                            {5, "", {{1, 2, 3, 4}}},
                            {1LL << 53, "c", {{0, 0, 0, 255}}},
                            {~std::uint64_t{0}, "d", {}}};
  const std::string v3 = to_json(image);
  EXPECT_EQ(parse_image_metadata(v3, "file"), image);
  EXPECT_EQ(json::parse(v3)["attributes"]["ome"]["image-label"], json::parse(R"({"version": "0.5",
              "colors": [{"label-value": 5, "rgba": [1, 2, 3, 4]},
                         {"label-value": 9007199254740992, "rgba": [0, 0, 0, 255]}],
              "properties": [{"label-value": -3, "name": "a \"b\""},
                             {"label-value": 9007199254740992, "name": "c"},
                             {"label-value": 18446744073709551615, "name": "d"}]})"));
  const std::string v2 = to_zattrs(image);
  EXPECT_EQ(json::parse(v2)["image-label"]["version"], "0.4");
  EXPECT_EQ(parse_image_metadata(v3_from_zattrs(v2, "file"), "file").labels, image.labels);
  image.labels.emplace();
  EXPECT_EQ(parse_image_metadata(to_json(image), "file"), image) << "a label image without names";
  EXPECT_EQ(json::parse(to_json(image))["attributes"]["ome"]["image-label"],
            json::parse(R"({"version": "0.5"})"));
  image.labels.reset();
  EXPECT_EQ(to_json(image).find("image-label"), std::string::npos);
}

TEST(LabelMetadata, TooManyToKeep) {
  LabelTable table;
  for (std::size_t i = 0; i <= kMaxDescribedLabels; ++i)
    table.push_back({static_cast<std::int64_t>(i), "n", {}});
  EXPECT_EQ(image_label_json(table).dump(), R"({"version":"0.5"})");
  table.pop_back();
  EXPECT_EQ(image_label_json(table)["properties"].size(), kMaxDescribedLabels);
}

TEST(LabelMetadata, OthersMayChangeNames) {
  ImageMetadata image;
  image.levels = {{"0", {}}};
  image.labels = theirs();
  const auto checksum = [](const ImageMetadata& of) {
    return metadata_checksum(to_json(of), std::vector<std::string>{"{}"}, "file");
  };
  const std::uint32_t before = checksum(image);
  image.labels->front().name = "spleen";
  EXPECT_EQ(checksum(image), before);
}

TEST(LabelMetadata, NamesInTheGroup) {
  const TemporaryFolder folder;
  const auto names = [&] { return label_image_names(*open_storage((folder / "a.zarr").string())); };
  write_file(folder / "a.zarr/zarr.json", "{}");
  EXPECT_TRUE(names().empty());
  write_file(folder / "a.zarr/labels/.zattrs", R"({"labels": ["nuclei", "cells/0"]})");
  EXPECT_EQ(names(), (std::vector<std::string>{"nuclei", "cells/0"}));
  write_file(
      folder / "a.zarr/labels/zarr.json",
      R"({"zarr_format": 3, "node_type": "group", "attributes": {"ome": {"labels": ["b"]}}})");
  EXPECT_EQ(names(), (std::vector<std::string>{"b"}));
  for (const char* text : {"{}", R"({"attributes": {}})", R"({"attributes": {"ome": {}}})"}) {
    write_file(folder / "a.zarr/labels/zarr.json", text);
    EXPECT_TRUE(names().empty()) << text;
  }
  for (const char* text : {"", "[", R"({"attributes": {"ome": {"labels": 3}}})",
                           R"({"attributes": {"ome": {"labels": [3]}}})"}) {
    write_file(folder / "a.zarr/labels/zarr.json", text);
    EXPECT_THROW(names(), DamageError) << text;
  }
}

}  // namespace
}  // namespace isobrick::test
