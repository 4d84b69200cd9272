#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <isobrick/attributes.h>
#include <isobrick/error.h>
#include <isobrick/mesh_sinks.h>
#include "tests/pipeline/convert_store.h"

// Samples of a volume at points of the world.
namespace isobrick::test {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

/// A field that trilinear interpolation gives exactly, in samples.
double linear(Vec3d p) { return 3 + 2 * p.x + 5 * p.y - 1.5 * p.z; }

template <class T>
std::vector<T> linear_samples(Int3 extent) {
  std::vector<T> samples(static_cast<std::size_t>(volume(extent)));
  for_each_point({{0, 0, 0}, extent}, [&](Int3 p) {
    const Vec3d at{double(p.x), double(p.y), double(p.z)};
    samples[static_cast<std::size_t>(linear_index(p, extent))] =
        static_cast<T>(std::is_unsigned_v<T> ? at.x + at.y + at.z : linear(at));
  });
  return samples;
}

/// Neither aligned nor of cubes.
Transform turned() {
  Transform transform;
  transform.spacing = {0.5, 2, 1.25};
  transform.origin = {-10, 4, 100};
  const double c = std::cos(0.7), s = std::sin(0.7);
  transform.direction = {c, -s, 0, s, c, 0, 0, 0, 1};
  transform.unit = "millimeter";
  return transform;
}

class Sample : public testing::Test {
 protected:
  template <class T>
  StoreReader store(const std::string& name, Int3 extent, const std::vector<T>& samples,
                    const Transform& transform = {}, int brick = 16) const {
    MemorySource source(extent, scalar_type_of<T>, as_bytes(samples));
    source.mutable_info().transform = transform;
    convert_quietly(source, folder_ / name, {.brick = brick, .shard = 2 * brick});
    return StoreReader(folder_ / name);
  }

  /// Points in and around a volume, in samples of it.
  static std::vector<Vec3d> points(Int3 extent, std::size_t count) {
    std::vector<Vec3d> points;
    std::uint32_t state = 1;
    const auto next = [&state] {
      state = state * 1664525u + 1013904223u;
      return (state >> 8) / 16777216.0;
    };
    for (std::size_t i = 0; i < count; ++i) {
      Vec3d p;
      for (int axis = 0; axis < 3; ++axis) p[axis] = next() * double(extent[axis] - 1);
      points.push_back(p);
    }
    return points;
  }
  static std::vector<Vec3f> in_world(const std::vector<Vec3d>& points, const Transform& transform,
                                     double ratio = 1) {
    std::vector<Vec3f> world;
    for (const Vec3d& p : points) {
      const Vec3d w = transform.apply(p) * ratio;
      world.push_back({float(w.x), float(w.y), float(w.z)});
    }
    return world;
  }
  static std::vector<float> sampled(const StoreReader& store, const std::vector<Vec3f>& positions,
                                    const SampleOptions& options = {}) {
    std::vector<float> values(positions.size(), -77);
    VolumeSampler(store, options).sample(positions, values);
    return values;
  }

  TemporaryFolder folder_;
};

template <class T>
void expect_linear(const std::vector<float>& values, const std::vector<Vec3d>& points,
                   double tolerance) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3d p = points[i];
    const double expected = std::is_unsigned_v<T> ? p.x + p.y + p.z : linear(p);
    ASSERT_NEAR(values[i], expected, tolerance) << i;
  }
}

TEST_F(Sample, ALinearFieldIsExactInEveryType) {
  const Int3 extent{41, 35, 29};
  const auto points = this->points(extent, 3000);
  const auto check = [&](auto tag, const char* name) {
    using T = typename decltype(tag)::type;
    std::vector<T> samples = linear_samples<T>(extent);
    if constexpr (std::is_integral_v<T> && std::is_signed_v<T>) return;
    const StoreReader reader = store<T>(name, extent, samples);
    expect_linear<T>(sampled(reader, in_world(points, {})), points, 5e-5);
  };
  check(TypeTag<std::uint8_t>{}, "u8");
  check(TypeTag<std::uint16_t>{}, "u16");
  check(TypeTag<std::uint32_t>{}, "u32");
  check(TypeTag<float>{}, "f32");
  check(TypeTag<double>{}, "f64");
}

TEST_F(Sample, WholeCoordinatesGiveTheSamplesThemselves) {
  const Int3 extent{20, 18, 17};
  const auto samples = make_samples<std::int16_t>(extent, 5);
  const StoreReader reader = store("i16", extent, samples);
  std::vector<Vec3f> positions;
  for_each_point({{0, 0, 0}, extent}, [&](Int3 p) {
    positions.push_back({float(p.x), float(p.y), float(p.z)});
  });
  const auto values = sampled(reader, positions);
  for (std::size_t i = 0; i < values.size(); ++i) ASSERT_EQ(values[i], float(samples[i])) << i;
}

TEST_F(Sample, TurnedVolumesAndUnitsAreOfTheWorld) {
  const Int3 extent{41, 35, 29};
  const StoreReader reader = store("turned", extent, linear_samples<float>(extent), turned());
  const auto points = this->points(extent, 2000);
  expect_linear<float>(sampled(reader, in_world(points, turned())), points, 1e-3);
  expect_linear<float>(sampled(reader, in_world(points, turned(), 1000), {.unit = "micrometer"}),
                       points, 1e-3);
  // A volume without a unit has the one that is given for it.
  Transform plain = turned();
  plain.unit.clear();
  const StoreReader unknown = store("unknown", extent, linear_samples<float>(extent), plain);
  expect_linear<float>(sampled(unknown, in_world(points, plain), {.unit = "micrometer"}), points,
                       1e-3);
  expect_linear<float>(sampled(unknown, in_world(points, plain, 1000),
                               {.unit = "micrometer", .volume_unit = "millimeter"}),
                       points, 1e-3);
}

TEST_F(Sample, OutsideThereIsNaN) {
  const Int3 extent{20, 18, 17};
  const StoreReader reader = store("a", extent, linear_samples<float>(extent));
  const std::vector<Vec3f> positions{{-0.01f, 3, 3}, {19.01f, 3, 3}, {3, -1, 3},    {3, 3, 16.5f},
                                     {kNaN, 3, 3},   {1e30f, 3, 3},  {3, 3, -1e30f}};
  for (const float value : sampled(reader, positions)) EXPECT_TRUE(std::isnan(value)) << value;
  // The border itself is inside, and what rounding adds.
  const auto border =
      sampled(reader, {{0, 0, 0}, {19, 17, 16}, {-0.0005f, 0, 0}, {19.0005f, 17, 16}});
  EXPECT_EQ(border[0], 3);
  EXPECT_EQ(border[1], float(linear({19, 17, 16})));
  EXPECT_EQ(border[2], border[0]);
  EXPECT_EQ(border[3], border[1]);
}

TEST_F(Sample, NaNIsWhereASampleWithAWeightIsNaN) {
  const Int3 extent{20, 18, 17};
  auto samples = linear_samples<float>(extent);
  samples[static_cast<std::size_t>(linear_index({10, 5, 5}, extent))] = kNaN;
  samples[static_cast<std::size_t>(linear_index({3, 3, 3}, extent))] =
      std::numeric_limits<float>::infinity();
  const StoreReader reader = store("nan", extent, samples);
  const auto values = sampled(
      reader, {{9.5f, 5, 5}, {10, 5, 5}, {10.9f, 5.9f, 4.1f}, {9, 5, 5}, {11, 5, 5}, {3, 3, 2}});
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(std::isnan(values[std::size_t(i)])) << i;
  EXPECT_EQ(values[3], float(linear({9, 5, 5})));
  EXPECT_EQ(values[4], float(linear({11, 5, 5})));
  EXPECT_EQ(values[5], float(linear({3, 3, 2})));
}

TEST_F(Sample, AnAxisOfOneSampleIsHalfASampleThick) {
  const Int3 extent{20, 18, 1};
  Transform transform;
  transform.spacing = {1, 1, 4};
  const StoreReader reader = store("flat", extent, linear_samples<float>(extent), transform);
  const auto values =
      sampled(reader, {{3.5f, 4, 0}, {3.5f, 4, 1.9f}, {3.5f, 4, -1.9f}, {3, 4, 2.1f}});
  for (int i = 0; i < 3; ++i) EXPECT_EQ(values[std::size_t(i)], float(linear({3.5, 4, 0}))) << i;
  EXPECT_TRUE(std::isnan(values[3]));
}

TEST_F(Sample, AbsentBricksHaveTheFillValue) {
  const Int3 extent{48, 32, 32};
  MemorySource source(extent, ScalarType::f32,
                      as_bytes(std::vector<float>(std::size_t(volume(extent)), -2.5f)));
  source.mutable_info().fill_value = -2.5;
  convert_quietly(source, folder_ / "fill", {.brick = 16, .shard = 32});
  const StoreReader reader(folder_ / "fill");
  EXPECT_EQ(sampled(reader, {{15.5f, 15.5f, 15.5f}}), std::vector<float>{-2.5f});
}

TEST_F(Sample, MemoryThreadsAndBricksNeverShow) {
  const Int3 extent{70, 50, 40};
  const auto samples = make_samples<float>(extent, 4);
  const StoreReader reader = store("b16", extent, samples, turned());
  const auto positions = in_world(points(extent, 6000), turned());
  const auto expected = sampled(reader, positions);
  const auto same = [&](const std::vector<float>& values) {
    return std::memcmp(values.data(), expected.data(), values.size() * sizeof(float)) == 0;
  };
  EXPECT_TRUE(same(sampled(reader, positions, {.threads = 1, .memory = 1})));
  EXPECT_TRUE(same(sampled(reader, positions, {.threads = 5, .memory = 300000})));
  EXPECT_TRUE(same(sampled(store("b32", extent, samples, turned(), 32), positions)));
  // In pieces.
  std::vector<float> values(positions.size());
  VolumeSampler sampler(reader, {.memory = 200000});
  for (std::size_t first = 0; first < positions.size(); first += 777) {
    const std::size_t count = std::min<std::size_t>(777, positions.size() - first);
    sampler.sample(std::span(positions).subspan(first, count),
                   std::span(values).subspan(first, count));
  }
  EXPECT_TRUE(same(values));
}

TEST_F(Sample, BricksAreReadOnceWhereThereIsRoom) {
  const Int3 extent{70, 50, 40};
  const StoreReader reader = store("a", extent, make_samples<float>(extent, 4));
  VolumeSampler sampler(reader);
  const auto positions = in_world(points(extent, 40000), {});
  std::vector<float> values(positions.size());
  sampler.sample(positions, values);
  sampler.sample(positions, values);
  EXPECT_EQ(sampler.bricks_read(), 5u * 4 * 3);
  values.pop_back();
  EXPECT_THROW(sampler.sample(positions, values), UsageError);
}

TEST_F(Sample, ASinkAddsValuesToTheChunks) {
  const Int3 extent{20, 18, 17};
  const StoreReader reader = store("a", extent, linear_samples<float>(extent), turned());
  const std::vector<Vec3d> points{{1, 2, 3}, {4.5, 5, 6}, {100, 0, 0}};
  const auto positions = in_world(points, turned(), 1000);
  std::vector<float> seen;
  FunctionSink end([&](const MeshChunk& chunk) {
    ASSERT_EQ(chunk.attributes.size(), 2u);
    EXPECT_EQ(chunk.attributes[0].name, "first");
    EXPECT_EQ(chunk.attributes[1].name, "second");
    EXPECT_EQ(chunk.positions.size(), 3u);
    seen.assign(chunk.attributes[1].values.begin(), chunk.attributes[1].values.end());
  });
  AttributeSink sink(end, {{"first", &reader}, {"second", &reader}});
  EXPECT_GT(sink.memory(), 0u);
  sink.begin({.unit = "micrometer"});
  sink.write({.positions = positions});
  sink.finish();
  ASSERT_EQ(seen.size(), 3u);
  EXPECT_NEAR(seen[0], linear(points[0]), 1e-3);
  EXPECT_NEAR(seen[1], linear(points[1]), 1e-3);
  EXPECT_TRUE(std::isnan(seen[2]));
}

TEST(AttributeColours, AreThoseOfTheScale) {
  const VertexColour first{0x44, 0x01, 0x54, 255}, last{0xfd, 0xe7, 0x25, 255};
  for (const auto& [low, high] : {std::pair(-2.0, 6.0), std::pair(6.0, -2.0)}) {
    const AttributeColours colours{"p", low, high};
    const bool rises = low < high;
    const float inf = std::numeric_limits<float>::infinity();
    for (const float value : {-2.F, -3.F, -1e30F, -inf})
      EXPECT_EQ(colours.colour_of(value), rises ? first : last);
    for (const float value : {6.F, 7.F, 1e30F, inf})
      EXPECT_EQ(colours.colour_of(value), rises ? last : first);
    EXPECT_EQ(colours.colour_of(2), (VertexColour{0x21, 0x91, 0x8c, 255}));
    EXPECT_EQ(colours.colour_of(kNaN), (VertexColour{128, 128, 128, 255}));
  }
  const AttributeColours grey{"p", 0, 255, ColourMap::grey};
  for (int i = 0; i < 256; ++i)
    EXPECT_EQ(grey.colour_of(static_cast<float>(i))[1], static_cast<std::uint8_t>(i));
  EXPECT_EQ((AttributeColours{"p", 0, 1, ColourMap::coolwarm}.colour_of(0.5F)),
            (VertexColour{0xdd, 0xdd, 0xdd, 255}));
}

TEST(AttributeColours, ASinkAddsThem) {
  std::vector<VertexColour> seen;
  FunctionSink end([&](const MeshChunk& chunk) {
    seen.assign(chunk.colours.begin(), chunk.colours.end());
    EXPECT_EQ(chunk.attributes.size(), 2u);
  });
  ColourSink sink(end, {"q", 0, 1, ColourMap::grey});
  EXPECT_THROW(sink.begin({.attributes = {"p"}}), UsageError);
  EXPECT_THROW(sink.begin({}), UsageError);
  sink.begin({.attributes = {"p", "q"}});
  const std::vector<Vec3f> positions(2);
  const std::vector<float> p{5, 5}, q{0, 1};
  const VertexAttribute attributes[] = {{"p", p}, {"q", q}};
  sink.write({.positions = positions, .attributes = attributes});
  EXPECT_EQ(seen, (std::vector<VertexColour>{{0, 0, 0, 255}, {255, 255, 255, 255}}));
  EXPECT_THROW(ColourSink(end, {"q", 1, 1}), UsageError);
  EXPECT_THROW(ColourSink(end, {"q", 0, kNaN}), UsageError);
}

TEST(AttributeNames, MustBeIdentifiersOfTheirOwn) {
  const auto refused = [](std::vector<std::string> names) {
    try {
      check_attribute_names(names);
    } catch (const UsageError&) {
      return true;
    }
    return false;
  };
  EXPECT_FALSE(refused({}));
  EXPECT_FALSE(refused({"pressure", "T_2", "_x"}));
  for (const char* name :
       {"", "2p", "a b", "a-b", "\xc3\xa4", "a\n", "x", "X", "ny", "red", "Normals"})
    EXPECT_TRUE(refused({name})) << name;
  EXPECT_TRUE(refused({"p", "q", "p"}));
  EXPECT_TRUE(refused({"p", "P"}));
  EXPECT_TRUE(refused({std::string(65, 'a')}));
  EXPECT_TRUE(refused(std::vector<std::string>(33, "p")));
}

}  // namespace
}  // namespace isobrick::test
