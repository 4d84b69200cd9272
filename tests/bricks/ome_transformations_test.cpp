#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include <isobrick/image_metadata.h>
#include "tests/bricks/store_fixture.h"

// OME-Zarr 0.6 as its specification has it, and what 0.5 forbids.
namespace isobrick::test {
namespace {

using nlohmann::json;

json axes(const std::string& unit, bool channel = false) {
  json list = json::array();
  if (channel) list.push_back({{"name", "c"}, {"type", "channel"}});
  for (const char* name : {"z", "y", "x"})
    list.push_back({{"name", name}, {"type", "space"}, {"unit", unit}});
  return list;
}

json leading(json transformation, const json& from, const json& to) {
  transformation["input"] = from;
  transformation["output"] = to;
  return transformation;
}

const json kScale{{"type", "scale"}, {"scale", {3, 2, 1}}};
const json kTranslation{{"type", "translation"}, {"translation", {30, 20, 10}}};

json sequence(const json& list) { return {{"type", "sequence"}, {"transformations", list}}; }

class Ome06 : public testing::Test {
 protected:
  Ome06() {
    scale["coordinateSystems"] = {{{"name", "world"}, {"axes", axes("millimeter")}},
                                  {{"name", "intrinsic"}, {"axes", axes("micrometer")}}};
    set_own(kScale);
  }

  void set_own(const json& transformation) {
    scale["datasets"] = {{{"path", "s0"},
                          {"coordinateTransformations",
                           {leading(transformation, {{"path", "s0"}}, {{"name", "intrinsic"}})}}}};
  }
  void set_common(const json& transformation) {
    scale["coordinateTransformations"] = {
        leading(transformation, {{"name", "intrinsic"}}, {{"name", "world"}})};
  }

  ImageMetadata read() const {
    json group{{"zarr_format", 3}, {"node_type", "group"}};
    group["attributes"]["ome"] = {{"version", version}, {"multiscales", {scale}}};
    return parse_image_metadata(group.dump(), "file");
  }
  Transform transform() const { return read().levels.at(0).transform; }

  template <class E>
  void expect_refused(const std::string& part) const {
    try {
      read();
      ADD_FAILURE() << "accepted: " << part;
    } catch (const E& e) {
      EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
    }
  }

  std::string version = "0.6";
  json scale{{"name", "image"}};
};

TEST_F(Ome06, ScaleTranslationAndSequence) {
  EXPECT_EQ(transform().spacing, (Vec3d{1, 2, 3}));
  EXPECT_EQ(transform().unit, "micrometer");
  EXPECT_TRUE(transform().axis_aligned());
  set_own(sequence({kScale, kTranslation}));
  for (const char* name : {"0.6", "0.6.dev4", "0.6rc1"}) {
    version = name;
    EXPECT_EQ(transform().spacing, (Vec3d{1, 2, 3}));
    EXPECT_EQ(transform().origin, (Vec3d{10, 20, 30}));
  }
  // Each of a sequence takes what the one before it gives.
  set_own(sequence({kTranslation, sequence({kScale, {{"type", "identity"}}})}));
  EXPECT_EQ(transform().origin, (Vec3d{10, 40, 90}));
  version = "0.60";
  expect_refused<Error>("OME-Zarr 0.60");
}

TEST_F(Ome06, ARotationBecomesTheDirection) {
  // x to y, y to -x; matrices are in the order z, y, x.
  const json rotation{{"type", "rotation"}, {"rotation", {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}}}};
  set_common(sequence({kTranslation, rotation}));
  const Transform t = transform();
  EXPECT_EQ(t.spacing, (Vec3d{1, 2, 3}));
  EXPECT_EQ(t.unit, "millimeter");
  EXPECT_EQ(t.direction, (std::array<double, 9>{0, -1, 0, 1, 0, 0, 0, 0, 1}));
  EXPECT_EQ(t.origin, (Vec3d{-20, 10, 30}));
  EXPECT_EQ(t.apply({1, 0, 0}), (Vec3d{-20, 11, 30}));
  const double s = std::sin(0.3), c = std::cos(0.3);
  set_common({{"type", "rotation"}, {"rotation", {{1, 0, 0}, {0, c, s}, {0, -s, c}}}});
  EXPECT_NEAR(transform().apply({0, 1, 0}).x, -2 * s, 1e-12);
  EXPECT_NEAR(transform().apply({0, 1, 0}).y, 2 * c, 1e-12);
}

TEST_F(Ome06, AnAffineIsReadUnlessItShears) {
  set_common({{"type", "affine"}, {"affine", {{5, 0, 0, 7}, {0, 0, 2, 8}, {0, 4, 0, 9}}}});
  const Transform t = transform();
  EXPECT_EQ(t.spacing, (Vec3d{2, 8, 15}));
  EXPECT_EQ(t.origin, (Vec3d{9, 8, 7}));
  EXPECT_EQ(t.apply({1, 1, 1}), (Vec3d{17, 10, 22})) << "x and y change places";
  set_common({{"type", "affine"}, {"affine", {{1, 0, 0, 0}, {0, 1, 0.5, 0}, {0, 0, 1, 0}}}});
  expect_refused<Error>("'affine'");
  // A rotation of cells that are no cubes, before they are scaled, shears them.
  const json rotation{{"type", "rotation"}, {"rotation", {{1, 0, 0}, {0, .8, .6}, {0, -.6, .8}}}};
  set_common({{"type", "identity"}});
  set_own(sequence({rotation, kScale}));
  expect_refused<Error>("shears");
}

TEST_F(Ome06, OtherAxesStayApart) {
  for (json& system : scale["coordinateSystems"]) system["axes"] = axes("micrometer", true);
  set_own({{"type", "affine"},
           {"affine", {{7, 0, 0, 0, 9}, {0, 3, 0, 0, 1}, {0, 0, 2, 0, 2}, {0, 0, 0, 1, 3}}}});
  EXPECT_EQ(read().leading.size(), 1u);
  EXPECT_EQ(transform().spacing, (Vec3d{1, 2, 3}));
  EXPECT_EQ(transform().origin, (Vec3d{3, 2, 1}));
  set_own({{"type", "rotation"},
           {"rotation", {{0, 1, 0, 0}, {1, 0, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}}});
  expect_refused<Error>("mixes space with other axes");
}

TEST_F(Ome06, WhatIsAmbiguousUnknownOrBrokenIsNamed) {
  set_common({{"type", "displacements"}, {"path", "field"}});
  expect_refused<Error>("'displacements'");
  set_common({{"type", "affine"}, {"path", "matrix"}});
  expect_refused<Error>("'affine' whose numbers are an array");
  // Of several systems behind the intrinsic one none is preferred.
  set_common({{"type", "scale"}, {"scale", {2, 2, 2}}});
  scale["coordinateTransformations"].push_back(scale["coordinateTransformations"][0]);
  EXPECT_EQ(transform().spacing, (Vec3d{1, 2, 3}));
  // A way back to where it came from ends.
  scale["coordinateTransformations"][1] = leading(kScale, "world", "intrinsic");
  EXPECT_EQ(transform().spacing, (Vec3d{2, 8, 18}));
  scale.erase("coordinateTransformations");
  set_own({{"type", "rotation"}, {"rotation", {{1, 0}, {0, 1}}}});
  expect_refused<DamageError>("3 rows");
  set_own({{"type", "affine"}, {"affine", {{0, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}}});
  expect_refused<DamageError>("positive");
  set_own(kScale);
  scale["datasets"][0]["coordinateTransformations"][0]["output"] = {{"name", "nowhere"}};
  expect_refused<DamageError>("no 'nowhere'");
  scale["datasets"][0]["coordinateTransformations"].push_back(kScale);
  expect_refused<DamageError>("one transformation, has 2");
}

TEST(Ome05, ListsAreAScaleAndATranslationAfterIt) {
  const auto read = [](const json& list) {
    json group{{"zarr_format", 3}, {"node_type", "group"}};
    const json datasets{{{"path", "0"}, {"coordinateTransformations", list}}};
    group["attributes"]["ome"] = {
        {"version", "0.5"}, {"multiscales", {{{"axes", axes("meter")}, {"datasets", datasets}}}}};
    return parse_image_metadata(group.dump(), "file").levels.at(0).transform;
  };
  EXPECT_EQ(read({kScale, kTranslation}).origin, (Vec3d{10, 20, 30}));
  EXPECT_THROW(read({kScale, kScale}), DamageError);
  EXPECT_THROW(read({kScale, kTranslation, kTranslation}), DamageError);
  EXPECT_THROW(read({kTranslation, kScale}), DamageError);
}

}  // namespace
}  // namespace isobrick::test
