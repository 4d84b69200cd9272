#include <gtest/gtest.h>

#include <algorithm>

#include <isobrick/image_metadata.h>
#include "bricks/ranges/stored_ranges.h"
#include "bricks/stored_index.h"
#include "bricks/zarr/array_metadata.h"
#include "pipeline/histogram/histogram.h"
#include "tests/pipeline/foreign_image.h"
#include "tests/pipeline/index_fixture.h"
#include "tests/pipeline/naive_counts.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class ForeignIndex : public ::testing::Test {
 protected:
  template <class T>
  void compare(Int3 extent, Int3 chunk, const std::vector<T>& samples, double iso) {
    fs::remove_all(ours_);
    fs::remove_all(foreign_);
    MemorySource source(extent, scalar_type_of<T>, as_bytes(samples));
    source.mutable_info().transform.spacing = {0.5, 1, 2};
    convert_quietly(source, ours_, {.levels = 1});
    const std::string mesh = mesh_of(ours_, {.isovalue = iso}, std::nullopt);
    ASSERT_FALSE(mesh.empty());
    SCOPED_TRACE(chunk.x);
    write_foreign(foreign_, extent, chunk, samples);
    const auto before = tree_of(foreign_);
    EXPECT_NE(message_of([&] {
                mesh_of(foreign_, {.isovalue = iso}, std::nullopt);
              }).find("isobrick index"),
              std::string::npos);
    for (const IndexKind kind : kStoredKinds) {
      const IndexReport report = add_index_quietly(foreign_, {.kind = kind, .leaf = 8});
      EXPECT_EQ(report.ranges_added, kind == kStoredKinds[0]);
      EXPECT_TRUE(mesh_of(foreign_, {.isovalue = iso}, kind) == mesh);
    }
    EXPECT_TRUE(mesh_of(foreign_, {.isovalue = iso}, std::nullopt) == mesh);
    EXPECT_EQ(stored_counts(StoreReader(foreign_)), naive_counts<T>(samples));
    EXPECT_EQ(verify_quietly(foreign_).damages, std::vector<std::string>{});
    // What the other program wrote is as it was.
    const auto after = tree_of(foreign_);
    for (const auto& [file, bytes] : before) EXPECT_TRUE(after.at(file) == bytes) << file;
    for (const auto& [file, bytes] : after)
      EXPECT_TRUE(before.contains(file) || file.starts_with("isobrick/")) << file;
  }

  TemporaryFolder folder_;
  fs::path ours_ = folder_ / "ours", foreign_ = folder_ / "foreign";
};

TEST_F(ForeignIndex, ChunksOfAnyShape) {
  const Int3 extent{150, 70, 81};
  const auto samples = make_samples<std::uint16_t>(extent, 5);
  for (const Int3 chunk :
       {Int3{150, 70, 1}, Int3{17, 30, 9}, Int3{200, 200, 200}, Int3{32, 32, 32}})
    compare(extent, chunk, samples, 30000);
}

TEST_F(ForeignIndex, KnowsWhetherThereIsNaN) {
  const Int3 extent{70, 40, 50};
  compare(extent, {20, 20, 20}, make_samples<float>(extent, 5, true), 0.5);
  EXPECT_TRUE(StoreReader(foreign_).info().may_have_nan);
  compare(extent, {20, 20, 20}, make_samples<float>(extent, 5, false), 0.5);
  EXPECT_FALSE(StoreReader(foreign_).info().may_have_nan);
}

TEST_F(ForeignIndex, ChangedMetadataMakesTheRangesThoseOfAnotherImage) {
  const Int3 extent{70, 40, 50};
  const auto samples = make_samples<std::uint8_t>(extent, 5);
  write_foreign(foreign_, extent, {20, 20, 20}, samples);
  add_index_quietly(foreign_, {});
  const std::string mesh = mesh_of(foreign_, {.isovalue = 90}, IndexKind::octree);
  write_foreign(foreign_, {70, 40, 49}, {20, 20, 20}, samples);
  EXPECT_FALSE(StoreReader(foreign_).has_ranges(0));
  for (const auto kind : {std::optional<IndexKind>(), std::optional(IndexKind::octree)})
    EXPECT_THROW(mesh_of(foreign_, {.isovalue = 90}, kind), Error);
  EXPECT_THROW(add_index_quietly(foreign_, {}), UsageError);
  EXPECT_TRUE(add_index_quietly(foreign_, {.force = true}).ranges_added);
  EXPECT_FALSE(mesh_of(foreign_, {.isovalue = 90}, IndexKind::octree) == mesh);
  EXPECT_EQ(verify_quietly(foreign_).damage_count, 0u);
}

TEST_F(ForeignIndex, ChangedSamplesAreFoundByVerifyAndMendedByForce) {
  const Int3 extent{70, 40, 50};
  auto samples = make_samples<std::uint8_t>(extent, 5);
  for (auto& v : samples) v = v % 100;
  write_foreign(foreign_, extent, {20, 20, 20}, samples);
  add_index_quietly(foreign_, {.leaf = 4});
  samples[static_cast<std::size_t>(linear_index({30, 30, 30}, extent))] = 200;
  write_foreign(foreign_, extent, {20, 20, 20}, samples);
  EXPECT_GT(verify_quietly(foreign_).damage_count, 0u);
  add_index_quietly(foreign_, {.leaf = 4, .force = true});
  EXPECT_EQ(verify_quietly(foreign_).damages, std::vector<std::string>{});
  EXPECT_FALSE(mesh_of(foreign_, {.isovalue = 150}, IndexKind::octree).empty());
}

TEST_F(ForeignIndex, InterruptedRangesAreNone) {
  const Int3 extent{70, 40, 50};
  write_foreign(foreign_, extent, {20, 20, 20}, make_samples<std::uint8_t>(extent, 5));
  for (int step = 0; step < 2; ++step) {
    Stopping stopping(step == 0 ? "ranges" : "index", 0);
    EXPECT_THROW(add_index(foreign_, {.threads = 2}, stopping), Error);
    EXPECT_EQ(StoreReader(foreign_).has_ranges(0), step == 1);
    EXPECT_TRUE(stored_index_kinds(StoreReader(foreign_), 0).empty());
  }
  add_index_quietly(foreign_, {.resume = true});
  EXPECT_EQ(verify_quietly(foreign_).damage_count, 0u);
}

TEST_F(ForeignIndex, DamagedBookkeepingIsRefused) {
  const Int3 extent{70, 40, 50};
  write_foreign(foreign_, extent, {20, 20, 20}, make_samples<float>(extent, 5));
  add_index_quietly(foreign_, {});
  std::string text = content_of(foreign_ / ranges_file(""));
  text.replace(text.find("false"), 5, "true");
  std::ofstream(foreign_ / ranges_file("")) << text;
  EXPECT_THROW(StoreReader{foreign_}, DamageError);
  EXPECT_EQ(verify_quietly(foreign_).damage_count, 1u);
}

TEST_F(ForeignIndex, ABudgetTooSmallForAChunkIsRefused) {
  const Int3 extent{70, 40, 50};
  write_foreign(foreign_, extent, {1024, 1024, 16}, make_samples<std::uint16_t>(extent, 5));
  const auto before = tree_of(foreign_);
  EXPECT_THROW(add_index_quietly(foreign_, {.memory = std::uint64_t{130} << 20}), UsageError);
  EXPECT_TRUE(tree_of(foreign_) == before);
}

}  // namespace
}  // namespace isobrick::test
