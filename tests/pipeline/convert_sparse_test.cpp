#include "pipeline/convert/convert_sparse.h"

#include <gtest/gtest.h>

#include <isobrick/verify.h>
#include "pipeline/program_memory.h"
#include "pipeline/stored_bricks.h"
#include "tests/pipeline/convert_store.h"

namespace isobrick::test {
namespace {

/// A volume in memory that knows where it is the fill value.
class SparseMemory final : public VolumeSource {
 public:
  SparseMemory(const MemorySource& dense, Box3 there) : dense_(dense), there_(there) {}

  const VolumeInfo& info() const override { return dense_.info(); }
  bool random_access() const override { return true; }
  bool sparse() const override { return true; }
  bool is_fill(Box3 box) const override { return intersect(box, there_).empty(); }
  std::optional<std::uint64_t> constant(Box3 box) const override {
    return intersect(box, solid_) == box ? std::optional(bits_) : std::nullopt;
  }
  void read(Box3 box, std::byte* out) override {
    EXPECT_FALSE(asks_about_constants_ && constant(box).has_value());
    dense_.read(box, out);
  }

  MemorySource& dense() { return dense_; }
  /// All samples of `solid` are `bits`. `full`: no brick of it is to be read.
  void set_solid(Box3 solid, std::uint64_t bits, bool full) {
    solid_ = solid;
    bits_ = bits;
    asks_about_constants_ = full;
  }

 private:
  MemorySource dense_;
  Box3 there_;
  Box3 solid_;
  std::uint64_t bits_ = 0;
  bool asks_about_constants_ = false;
};

/// Noise in a box, the fill value elsewhere.
template <class T>
SparseMemory make_sparse(Int3 extent, Box3 there, double fill) {
  auto samples = make_samples<T>(extent, 9, true);
  std::size_t i = 0;
  for_each_point({{0, 0, 0}, extent}, [&](Int3 p) {
    if (!there.contains(p)) samples[i] = static_cast<T>(fill);
    ++i;
  });
  MemorySource dense(extent, scalar_type_of<T>, as_bytes(samples));
  dense.mutable_info().fill_value = fill;
  return {dense, there};
}

/// All but the shards, in which bricks have another order.
std::map<std::string, std::string> without_shards(std::map<std::string, std::string> tree) {
  std::erase_if(tree, [](const auto& file) { return file.first.find("/c/") == 1; });
  return tree;
}

template <class T>
void expect_dense_store(Int3 extent, Box3 there, double fill, const ConvertOptions& options) {
  TemporaryFolder folder;
  SparseMemory sparse = make_sparse<T>(extent, there, fill);
  const ConvertReport a = convert_quietly(sparse.dense(), folder / "dense", options);
  const std::uint64_t all = sparse.dense().bytes_read();
  const ConvertReport b = convert_quietly(sparse, folder / "sparse", options);
  EXPECT_LT(sparse.dense().bytes_read() - all, all * 2 / 3);
  EXPECT_EQ(a.bricks, b.bricks);
  EXPECT_EQ(a.bricks_absent, b.bricks_absent);
  EXPECT_EQ(without_shards(tree_of(folder / "dense")), without_shards(tree_of(folder / "sparse")));
  const StoreReader dense_store(folder / "dense"), store(folder / "sparse");
  for (int level = 0; level < b.levels; ++level)
    EXPECT_EQ(samples_of(store, level), samples_of(dense_store, level)) << level;
  NoProgress silent;
  EXPECT_EQ(verify(folder / "sparse", {.threads = 2}, silent).damage_count, 0u);
}

TEST(ConvertSparse, TheStoreIsThatOfTheDenseVolume) {
  const Int3 extent{131, 90, 150};
  const Box3 there{{60, 17, 64}, {120, 70, 129}};
  for (const Index brick : {16, 32, 64}) {
    SCOPED_TRACE(brick);
    const ConvertOptions options{.brick = brick, .shard = 64, .memory = 200 * kMiB, .threads = 3};
    expect_dense_store<std::uint8_t>(extent, there, 7, options);
    expect_dense_store<float>(extent, there, -2.5, options);
  }
}

TEST(ConvertSparse, LevelsThatHalveSomeAxes) {
  const Int3 extent{131, 90, 150};
  ConvertOptions options{.brick = 16, .shard = 64, .memory = 200 * kMiB, .threads = 3};
  options.factors = {{2, 2, 1}, {1, 2, 1}, {2, 2, 2}};
  for (const Downsampling method : kDownsamplings) {
    options.downsampling = method;
    expect_dense_store<float>(extent, {{60, 17, 64}, {120, 70, 129}}, 7, options);
  }
}

/// Bricks of one value that is not the fill value are neither read nor encoded one by one.
template <class T>
void expect_solid_bricks(T value, Box3 solid, bool full) {
  const Int3 extent{131, 90, 150};
  const Box3 there{{32, 0, 32}, {131, 90, 150}};
  auto samples = make_samples<T>(extent, 9, true);
  std::size_t i = 0;
  for_each_point({{0, 0, 0}, extent}, [&](Int3 p) {
    if (!there.contains(p)) samples[i] = T{3};
    if (solid.contains(p)) samples[i] = value;
    ++i;
  });
  MemorySource dense(extent, scalar_type_of<T>, as_bytes(samples));
  dense.mutable_info().fill_value = 3;
  SparseMemory sparse(dense, there);
  std::uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof value);
  sparse.set_solid(solid, bits, full);
  TemporaryFolder folder;
  const ConvertOptions options{.brick = 16, .shard = 64, .memory = 200 * kMiB, .threads = 3};
  convert_quietly(dense, folder / "dense", options);
  convert_quietly(sparse, folder / "sparse", options);
  EXPECT_EQ(without_shards(tree_of(folder / "dense")), without_shards(tree_of(folder / "sparse")));
  const StoreReader dense_store(folder / "dense"), store(folder / "sparse");
  for (int level = 0; level < 4; ++level)
    EXPECT_EQ(samples_of(store, level), samples_of(dense_store, level)) << level;
}

TEST(ConvertSparse, BricksOfOneValue) {
  const Box3 aligned{{48, 16, 48}, {112, 80, 112}};
  expect_solid_bricks<std::uint8_t>(200, aligned, true);
  expect_solid_bricks<float>(-3, aligned, true);
  expect_solid_bricks<float>(-0.0F, aligned, true);
  expect_solid_bricks<double>(std::numeric_limits<double>::max(), aligned, true);
  expect_solid_bricks<double>(std::numeric_limits<double>::quiet_NaN(), aligned, true);
  // To the volume's border, where bricks are padded with the fill value.
  expect_solid_bricks<std::int16_t>(-5, {{40, 10, 40}, {131, 90, 150}}, false);
}

/// Ranges in chunks of 512³ samples: bricks on both sides of a border between them.
TEST(ConvertSparse, AcrossChunksOfRanges) {
  expect_dense_store<std::uint8_t>({560, 40, 530}, {{500, 0, 500}, {530, 40, 530}}, 3,
                                   {.brick = 16, .shard = 64, .memory = 200 * kMiB});
}

TEST(ConvertSparse, ResumesToTheSameBytes) {
  TemporaryFolder folder;
  const ConvertOptions options{.brick = 16, .shard = 32, .memory = 200 * kMiB, .threads = 2};
  SparseMemory source = make_sparse<std::uint16_t>({100, 90, 130}, {{10, 10, 0}, {80, 80, 130}}, 5);
  convert_quietly(source, folder / "whole", options);
  SparseMemory broken = source;
  broken.dense().fail_after(1000000);
  EXPECT_THROW(convert_quietly(broken, folder / "a", options), Error);
  ConvertOptions resume = options;
  resume.resume = true;
  const ConvertReport report = convert_quietly(source, folder / "a", resume);
  EXPECT_GT(report.bricks_kept, 0u);
  EXPECT_EQ(tree_of(folder / "a"), tree_of(folder / "whole"));
}

/// A volume that is there from end to end and is never read.
class Endless final : public VolumeSource {
 public:
  explicit Endless(Int3 extent) {
    info_.extent = extent;
    info_.name = "endless";
  }
  const VolumeInfo& info() const override { return info_; }
  bool random_access() const override { return true; }
  bool sparse() const override { return true; }
  void read(Box3, std::byte*) override { FAIL() << "it was read"; }

 private:
  VolumeInfo info_;
};

/// Two samples in a large box, the fill value elsewhere.
class TwoSamples final : public VolumeSource {
 public:
  TwoSamples() {
    info_.extent = {3000, 2500, 2100};
    info_.type = ScalarType::f32;
    info_.name = "two";
    info_.fill_value = 1;
  }
  const VolumeInfo& info() const override { return info_; }
  bool random_access() const override { return true; }
  bool sparse() const override { return true; }
  bool is_fill(Box3 box) const override { return !box.contains(kA) && !box.contains(kB); }
  void read(Box3 box, std::byte* out) override {
    auto* samples = reinterpret_cast<float*>(out);
    std::fill_n(samples, volume(box.extent()), 1.0F);
    for (const Int3 p : {kA, kB})
      if (box.contains(p)) samples[linear_index(p - box.lo, box.extent())] = -1;
  }

  static constexpr Int3 kA{5, 5, 5}, kB{2816, 1000, 2000};

 private:
  VolumeInfo info_;
};

TEST(StoredBricks, OfALargeEmptyBoxOnlyThoseWithSamplesAreLookedUp) {
  TwoSamples source;
  TemporaryFolder folder;
  convert_quietly(source, folder / "a", {.levels = 1});
  const StoreReader store(folder / "a");
  std::vector<Int3> found;
  NoProgress none;
  const auto find = [&](const StoreReader& in, Box3 box) {
    found.clear();
    return for_each_stored_brick(in, 0, box, none, [&](Int3 b) { found.push_back(b); });
  };
  // The first sample of B's brick along x is in the range of the brick before it, too.
  EXPECT_EQ(find(store, {{0, 0, 0}, source.info().extent}), 3u);
  EXPECT_EQ(found, (std::vector<Int3>{{0, 0, 0}, {44, 15, 31}}));
  EXPECT_EQ(find(store, {{100, 0, 0}, source.info().extent}), 2u);
  EXPECT_EQ(found, (std::vector<Int3>{{44, 15, 31}}));
  EXPECT_EQ(find(store, {{64, 64, 64}, {2000, 2000, 2000}}), 0u);
}

TEST(StoredBricks, WithoutRangesAllAreLookedUp) {
  SparseMemory source = make_sparse<float>({100, 90, 70}, {{40, 40, 40}, {60, 60, 60}}, 3);
  TemporaryFolder folder;
  convert_quietly(source, folder / "a", {.brick = 32, .shard = 64, .levels = 1});
  std::filesystem::remove_all(folder / "a/isobrick");
  const StoreReader store(folder / "a");
  std::vector<Int3> found;
  NoProgress none;
  EXPECT_EQ(for_each_stored_brick(store, 0, {{0, 0, 0}, {100, 90, 70}}, none,
                                  [&](Int3 b) { found.push_back(b); }),
            4u * 3 * 3);
  EXPECT_EQ(found, (std::vector<Int3>{{1, 1, 1}}));
}

TEST(ConvertSparse, WhatIsRememberedOfEachBrickIsPartOfTheBudget) {
  Endless source({2048, 2048, 2048});  // 2 million bricks
  TemporaryFolder folder;
  try {
    convert_quietly(source, folder / "a", {.brick = 16, .memory = 150 * kMiB, .threads = 2});
    FAIL() << "the bricks were not counted";
  } catch (const UsageError& e) {
    EXPECT_NE(std::string(e.what()).find("150.0 MiB is too small"), std::string::npos) << e.what();
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "a.partial"));
}

/// Families of levels that are `factors` apart.
void expect_families(Int3 factors) {
  std::vector<SparseBrick> bricks;
  for_each_point({{0, 0, 0}, {5, 3, 4}}, [&](Int3 p) {
    if ((p.x + p.y + p.z) % 3 != 0) bricks.push_back({p, bricks.size()});
  });
  const SparseBricks sorted(bricks, factors);
  std::size_t families = 0, at = 0;
  Int3 last{-1, -1, -1};
  while (at < sorted.all().size()) {
    const auto family = sorted.family_at(at);
    const Int3 parent = sorted.parent_of(family.front().brick);
    EXPECT_LT(std::tuple(last.z, last.y, last.x), std::tuple(parent.z, parent.y, parent.x));
    for (const SparseBrick& b : family) EXPECT_EQ(sorted.parent_of(b.brick), parent);
    last = parent;
    at += family.size();
    ++families;
  }
  EXPECT_EQ(families, sorted.families());
  EXPECT_EQ(at, bricks.size());
  EXPECT_TRUE(sorted.family_at(at).empty());
  for_each_point({{0, 0, 0}, {5, 3, 4}},
                 [&](Int3 p) { EXPECT_EQ(sorted.contains(p), (p.x + p.y + p.z) % 3 != 0); });
}

TEST(SparseBricks, FamiliesStandTogetherInTheOrderOfTheirParents) {
  for (const Int3 factors : {Int3{2, 2, 2}, Int3{2, 2, 1}, Int3{1, 1, 2}}) expect_families(factors);
}

}  // namespace
}  // namespace isobrick::test
