#include <gtest/gtest.h>

#include <isobrick/verify.h>
#include "pipeline/convert/downsample.h"
#include "tests/pipeline/convert_store.h"

// Pyramids whose levels halve some axes only, or are made otherwise than by the mean.
namespace isobrick::test {
namespace {

constexpr Int3 kFlat{2, 2, 1};

/// Expects the levels to be `factors` apart, made by the method from the finest.
void expect_pyramid(const std::filesystem::path& path, const std::vector<Int3>& factors,
                    Downsampling method) {
  const StoreReader store(path);
  const std::vector<LevelInfo>& levels = store.info().levels;
  ASSERT_EQ(levels.size(), factors.size() + 1);
  std::vector<std::byte> samples = samples_of(store, 0);
  for (std::size_t i = 0; i < factors.size(); ++i) {
    const Int3 extent = levels[i].lattice.extent, next = levels[i + 1].lattice.extent;
    ASSERT_EQ(next, coarser_extent(extent, factors[i])) << i;
    EXPECT_EQ(levels[i + 1].transform,
              coarser_transform(levels[i].transform, extent, factors[i], method));
    std::vector<std::byte> coarser(bytes_of(next, store.info().type));
    downsample(method, store.info().type, extent, factors[i], samples.data(), coarser.data());
    EXPECT_EQ(samples_of(store, static_cast<int>(i) + 1), coarser) << i;
    samples = coarser;
  }
  NoProgress progress;
  EXPECT_EQ(verify(path, {.threads = 2}, progress).damage_count, 0u);
}

TEST(ConvertPyramid, HalvesBySpacing) {
  TemporaryFolder folder;
  MemorySource source = make_source<std::uint16_t>({260, 150, 21}, 4);
  source.mutable_info().transform.spacing = {0.4, 0.4, 4};
  convert_quietly(source, folder / "a", {.brick = 16, .shard = 64});
  expect_pyramid(folder / "a", {kFlat, kFlat, kFlat, kHalveAll, kHalveAll}, Downsampling::mean);
  const StoreReader store(folder / "a");
  EXPECT_EQ(store.info().levels[2].transform.spacing, (Vec3d{1.6, 1.6, 4}));
  EXPECT_NE(content_of(folder / "a/zarr.json").find("\"type\": \"mean\""), std::string::npos);
}

TEST(ConvertPyramid, EveryMethodAndPathWritesTheSame) {
  const Int3 extent{400, 300, 36};
  MemorySource source = make_source<float>(extent, 4, true);
  for (const Downsampling method : kDownsamplings) {
    SCOPED_TRACE(name_of(method));
    TemporaryFolder folder;
    ConvertOptions options{.brick = 16, .zstd_level = 1, .levels = 4, .threads = 2};
    options.factors = {kFlat, {1, 2, 2}, {2, 1, 1}};
    options.downsampling = method;
    convert_quietly(source, folder / "cascade", options);
    expect_pyramid(folder / "cascade", options.factors, method);
    options.memory = std::uint64_t{32} << 20;  // too little for a slab of the finest level
    convert_quietly(source, folder / "pieces", options);
    MemorySource stream(extent, ScalarType::f32, source.samples(), false);
    convert_quietly(stream, folder / "stream", options);
    EXPECT_EQ(tree_of(folder / "pieces"), tree_of(folder / "cascade"));
    EXPECT_EQ(tree_of(folder / "stream"), tree_of(folder / "cascade"));
  }
}

TEST(ConvertPyramid, TheLastFactorsHoldForAllFurtherSteps) {
  TemporaryFolder folder;
  MemorySource source = make_source<std::uint8_t>({100, 90, 50}, 2);
  ConvertOptions options{.brick = 16};
  options.factors = {kFlat};
  convert_quietly(source, folder / "a", options);
  // Until x and y are in one brick, which z never is.
  expect_pyramid(folder / "a", std::vector<Int3>(3, kFlat), Downsampling::mean);
  options.levels = 8;
  convert_quietly(source, folder / "b", options);
  expect_pyramid(folder / "b", std::vector<Int3>(7, kFlat), Downsampling::mean);
  options.levels = 9;
  EXPECT_THROW(convert_quietly(source, folder / "c", options), UsageError);
}

TEST(ConvertPyramid, PlanesThatAreFarApartEndInOneBrickToo) {
  TemporaryFolder folder;
  MemorySource source = make_source<std::uint8_t>({60, 30, 70}, 4);
  source.mutable_info().transform.spacing = {0.1, 0.1, 100};
  convert_quietly(source, folder / "a", {.brick = 16});
  const Int3 deep{1, 1, 2};
  expect_pyramid(folder / "a", {kFlat, kFlat, deep, deep, deep}, Downsampling::mean);
}

TEST(ConvertPyramid, AResumeRefusesAnotherMethodOrOtherFactors) {
  TemporaryFolder folder;
  MemorySource source = make_source<std::uint8_t>({64, 64, 80}, 3);
  MemorySource broken(source);
  broken.fail_after(source.samples().size() - 1);
  ConvertOptions options{.brick = 16};
  EXPECT_THROW(convert_quietly(broken, folder / "a", options), Error);
  options.resume = true;
  options.downsampling = Downsampling::max;
  EXPECT_THROW(convert_quietly(source, folder / "a", options), Error);
  options.downsampling = Downsampling::mean;
  options.factors = {kFlat};
  EXPECT_THROW(convert_quietly(source, folder / "a", options), Error);
  options.factors = {};
  convert_quietly(source, folder / "a", options);
}

TEST(ConvertPyramid, RefusesFactorsThatMakeNoSense) {
  TemporaryFolder folder;
  MemorySource source = make_source<std::uint8_t>({20, 20, 20}, 1);
  for (const Int3 factors : {Int3{1, 1, 1}, Int3{3, 2, 2}, Int3{2, 0, 2}})
    EXPECT_THROW(
        convert_quietly(source, folder / "a", {.brick = 16, .factors = {kHalveAll, factors}}),
        UsageError);
}

}  // namespace
}  // namespace isobrick::test
