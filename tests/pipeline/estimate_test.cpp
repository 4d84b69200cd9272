#include <isobrick/estimate.h>

#include <gtest/gtest.h>

#include <cmath>

#include <isobrick/error.h>
#include "core/morton.h"
#include "pipeline/extract/tile_sample.h"
#include "tests/pipeline/convert_store.h"
#include "tests/pipeline/least_budget.h"
#include "tests/pipeline/no_sink.h"

namespace isobrick::test {
namespace {

MeshSize extracted(const StoreReader& store, const ExtractOptions& options) {
  NoSink sink;
  NoProgress silent;
  const ExtractReport report = extract(store, options, sink, silent);
  return {report.vertices, report.triangles};
}

/// The estimate beside the mesh: off by less than `most` (a fraction).
void expect_near(const StoreReader& store, const ExtractOptions& options, double most) {
  const MeshSize mesh = extracted(store, options);
  const ExtractEstimate guess = estimate(store, options, 0);
  ASSERT_GT(mesh.triangles, 1000u);
  EXPECT_NEAR(static_cast<double>(guess.mesh.triangles), static_cast<double>(mesh.triangles),
              most * static_cast<double>(mesh.triangles));
  EXPECT_NEAR(static_cast<double>(guess.mesh.vertices), static_cast<double>(mesh.vertices),
              most * static_cast<double>(mesh.vertices));
  EXPECT_LE(guess.uncertainty, 2 * most);
  const MeshSize largest = largest_mesh(count_active(store, options), options.topology);
  EXPECT_LE(mesh.triangles, largest.triangles);
  EXPECT_LE(mesh.vertices, largest.vertices);
}

template <class T>
std::vector<T> sampled(Int3 extent, const std::function<double(Int3)>& f) {
  std::vector<T> samples;
  samples.reserve(static_cast<std::size_t>(volume(extent)));
  for_each_point({{0, 0, 0}, extent}, [&](Int3 p) { samples.push_back(static_cast<T>(f(p))); });
  return samples;
}

class Estimate : public ::testing::Test {
 protected:
  template <class T>
  StoreReader store(Int3 extent, const std::vector<T>& samples, ConvertOptions options) {
    MemorySource source(extent, scalar_type_of<T>, as_bytes(samples));
    options.force = true;
    convert_quietly(source, folder_ / "a.zarr", options);
    return StoreReader(folder_ / "a.zarr");
  }

  TemporaryFolder folder_;
};

/// Distances from a point, so that isosurfaces are spheres.
double distance(Int3 p, double x, double y, double z) {
  const double dx = static_cast<double>(p.x) - x, dy = static_cast<double>(p.y) - y,
               dz = static_cast<double>(p.z) - z;
  return std::sqrt(dx * dx + dy * dy + dz * dz);
}

TEST_F(Estimate, NearOnSmoothSurfacesWhateverTheBricks) {
  const Int3 extent{170, 131, 100};
  const auto samples = sampled<std::uint8_t>(
      extent, [](Int3 p) { return std::min(255.0, 3 * distance(p, 80, 66, 40)); });
  for (const Index brick : {16, 32, 64, 128, 256}) {
    SCOPED_TRACE(brick);
    const StoreReader reader = store(extent, samples, {.brick = brick, .shard = 256});
    expect_near(reader, {.isovalue = 120.5}, 0.1);
    expect_near(reader, {.isovalue = 120.5, .roi = Box3{{70, 3, 5}, {170, 90, 90}}}, 0.15);
    if (reader.info().levels.size() > 1) expect_near(reader, {.isovalue = 120.5, .level = 1}, 0.15);
  }
}

TEST_F(Estimate, NearOnNoiseAndWithNaN) {
  const Int3 extent{100, 131, 120};
  expect_near(store(extent, make_samples<std::uint16_t>(extent, 5), {.brick = 32, .shard = 64}),
              {.isovalue = 30000}, 0.05);
  expect_near(store(extent, make_samples<std::uint16_t>(extent, 5), {.brick = 32, .shard = 64}),
              {.isovalue = 30000, .topology = Topology::trilinear}, 0.05);
  auto samples = sampled<float>(extent, [](Int3 p) { return distance(p, 30, 60, 60); });
  for (std::size_t i = 0; i < samples.size(); i += 211) samples[i] = NAN;
  expect_near(store(extent, samples, {.brick = 64, .shard = 64}), {.isovalue = 45}, 0.1);
}

TEST_F(Estimate, SamplesOfAManyTimesLargerVolumeDo) {
  // 144 cubes of 64³, most of which the surface passes, smooth in one half and rough in the other.
  const Int3 extent{384, 384, 256};
  std::vector<double> wave;
  for (int i = 0; i < 384; ++i) wave.push_back(4 * std::sin(i / 3.0));
  const auto samples = sampled<std::uint8_t>(extent, [&](Int3 p) {
    const auto x = static_cast<std::size_t>(p.x), y = static_cast<std::size_t>(p.y);
    return std::min(distance(p, 190, 190, 120) + (p.x < 192 ? wave[x] * wave[y] : 0), 255.0);
  });
  const StoreReader reader = store(extent, samples, {.zstd_level = 1});
  ASSERT_LT(estimate(reader, {.isovalue = 180.5}, 0).uncertainty, 0.3);
  ASSERT_GT(estimate(reader, {.isovalue = 180.5}, 0).uncertainty, 0.02);  // not all was looked at
  expect_near(reader, {.isovalue = 180.5}, 0.25);
}

TEST_F(Estimate, ReadsOnlySoMuchAndIsTheSameForAnyMeans) {
  const Int3 extent{256, 256, 192};  // 96 MiB of f64, which noise does not compress
  const auto samples = sampled<double>(extent, [](Int3 p) {
    return static_cast<double>(
        (static_cast<std::uint64_t>(p.x * 7919 + p.y * 104729 + p.z) * 0x9e3779b97f4a7c15ULL) >>
        11);
  });
  const StoreReader reader = store(extent, samples, {.codec = BrickCodec::none});
  const double middle = 0x1p52;
  const std::uint64_t before = reader.bytes_read();
  const ExtractEstimate guess = estimate(reader, {.isovalue = middle, .threads = 1}, 0);
  EXPECT_LT(reader.bytes_read() - before, std::uint64_t{33} << 20);
  EXPECT_GT(guess.mesh.triangles, static_cast<std::uint64_t>(volume(extent)));
  for (const int threads : {2, 7}) {
    const ExtractEstimate again = estimate(
        reader, {.isovalue = middle, .memory = std::uint64_t{160} << 20, .threads = threads}, 0);
    EXPECT_EQ(again.mesh.triangles, guess.mesh.triangles);
    EXPECT_EQ(again.mesh.vertices, guess.mesh.vertices);
    EXPECT_EQ(again.uncertainty, guess.uncertainty);
  }
}

TEST_F(Estimate, NothingActiveIsNothing) {
  const Int3 extent{40, 40, 40};
  const StoreReader reader =
      store(extent, sampled<std::uint8_t>(extent, [](Int3) { return 9; }), {.brick = 16});
  const ExtractEstimate guess = estimate(reader, {.isovalue = 20}, 0);
  EXPECT_EQ(guess.mesh.triangles, 0u);
  EXPECT_EQ(guess.mesh.vertices, 0u);
  EXPECT_EQ(guess.uncertainty, 0);
  EXPECT_EQ(guess.active.active_blocks, 0u);
  EXPECT_THROW(estimate(reader, {.isovalue = NAN}, 0), UsageError);
  EXPECT_THROW(estimate(reader, {.isovalue = 5, .level = 7}, 0), UsageError);
}

/// What the sink takes is of the same budget, as it is in the extraction.
TEST_F(Estimate, TheSinksMemoryIsPartOfIt) {
  const Int3 extent{90, 90, 90};
  const StoreReader reader =
      store(extent, sampled<std::uint8_t>(extent, [](Int3 p) { return p.x; }), {.brick = 16});
  const auto least = [&](std::uint64_t sink) -> std::uint64_t {
    try {
      estimate(reader, {.isovalue = 40.5, .memory = 1, .threads = 2}, sink);
    } catch (const UsageError& e) {
      return least_budget_in(e.what());
    }
    return 0;
  };
  EXPECT_GT(least(0), std::uint64_t{1} << 20);
  EXPECT_EQ(least(std::uint64_t{3} << 20), least(0) + (std::uint64_t{3} << 20));
}

TEST(TileSample, TakesOneGroupOfEveryStratum) {
  for (const Index edge : {1, 2, 5, 8, 16, 31}) {
    TileSample sample(64);
    std::vector<std::uint64_t> cubes;
    for_each_morton({edge, edge, edge}, [&](Int3 tile) {
      sample.add({tile, 0xff});
      const std::uint64_t cube = morton_encode(tile) / 8;
      if (cubes.empty() || cubes.back() != cube) cubes.push_back(cube);
    });
    const std::vector<TileGroup> chosen = sample.chosen();
    std::size_t stratum = 1;
    while (ceil_div(static_cast<Index>(cubes.size()), static_cast<Index>(stratum)) > 64)
      stratum *= 2;
    ASSERT_EQ(chosen.size(), (cubes.size() + stratum - 1) / stratum) << edge;
    for (std::size_t i = 0; i < chosen.size(); ++i) {
      const auto begin = cubes.begin() + static_cast<std::ptrdiff_t>(i * stratum);
      const auto end =
          cubes.begin() + static_cast<std::ptrdiff_t>(std::min(cubes.size(), (i + 1) * stratum));
      EXPECT_NE(std::find(begin, end, chosen[i].cube), end);
      // All of the group's tiles, no other ones.
      const Int3 low = morton_decode(chosen[i].cube * 8);
      const Int3 room = min(Int3{edge, edge, edge} - low, {2, 2, 2});
      EXPECT_EQ(chosen[i].count, volume(room));
      for (int k = 0; k < chosen[i].count; ++k)
        EXPECT_EQ(morton_encode(chosen[i].tiles[k].tile) / 8, chosen[i].cube);
    }
  }
}

TEST(TileSample, IsNoGrid) {
  TileSample sample(64);
  for_each_morton({64, 64, 64}, [&](Int3 tile) { sample.add({tile, 0xff}); });
  const std::vector<TileGroup> chosen = sample.chosen();
  // Of each coordinate of the chosen cubes, both even and odd ones are common.
  for (int axis = 0; axis < 3; ++axis) {
    const auto odd = std::count_if(chosen.begin(), chosen.end(), [&](const TileGroup& group) {
      return morton_decode(group.cube)[axis] & 1;
    });
    EXPECT_GT(odd, 16) << axis;
    EXPECT_LT(odd, 48) << axis;
  }
}

}  // namespace
}  // namespace isobrick::test
