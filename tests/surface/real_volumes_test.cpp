#include <gtest/gtest.h>
#include <zstd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/surface/kept_triangles.h"

namespace isobrick::testing {
namespace {

template <class T>
Field<T> read_volume(const std::filesystem::path& file, Int3 extent) {
  std::ifstream in(file, std::ios::binary);
  const std::string packed{std::istreambuf_iterator<char>(in), {}};
  Field<T> field(extent);
  const std::size_t bytes = field.samples.size() * sizeof(T);
  const std::size_t got =
      ZSTD_decompress(field.samples.data(), bytes, packed.data(), packed.size());
  EXPECT_EQ(got, bytes) << file;
  return field;
}

TEST(RealVolumes, HeadWithoutDegenerateTriangles) {
  const auto field = read_volume<std::int16_t>(
      ISOBRICK_DATA "/headsq_quarter_64x64x93_int16.raw.zst", {64, 64, 93});
  for (const double iso : {500.0, 1150.0}) {
    const Mesh kept = expect_kept_triangles(field, {.isovalue = iso});
    EXPECT_GT(kept.triangles.size(), 10000u);
    EXPECT_GT(kept.degenerate, 0u);
  }
}

// Triangles as the literature counts them, which keeps degenerate ones.
TEST(RealVolumes, CountsOfTheLiterature) {
  const std::filesystem::path folder = ISOBRICK_TEST_DATA;
  const struct {
    const char* name;
    Int3 extent;
    double isovalue;
    std::size_t triangles;
  } volumes[] = {{"lobster_301x324x56_uint8", {301, 324, 56}, 45, 317024},
                 {"vis_male_128x256x256_uint8", {128, 256, 256}, 50, 544588}};
  for (const auto& v : volumes) {
    const std::filesystem::path file = folder / (std::string(v.name) + ".raw.zst");
    if (!std::filesystem::exists(file)) GTEST_SKIP() << "no " << file;
    const auto field = read_volume<std::uint8_t>(file, v.extent);
    const Mesh kept = expect_kept_triangles(field, {.isovalue = v.isovalue});
    EXPECT_EQ(kept.triangles.size() + kept.degenerate, v.triangles);
    EXPECT_GT(kept.degenerate, 0u);
  }
}

}  // namespace
}  // namespace isobrick::testing
