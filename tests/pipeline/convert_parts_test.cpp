#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>

#include <isobrick/error.h>
#include <isobrick/extract.h>
#include "tests/pipeline/convert_store.h"

// Parts of a conversion, made alone and joined: the store of a single conversion.

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class ConvertParts : public ::testing::Test {
 protected:
  /// Converts in so many parts, the last one first.
  void convert_parts(const MemorySource& source, const fs::path& out, ConvertOptions options,
                     std::uint32_t parts) {
    for (std::uint32_t i = parts; i >= 1; --i) {
      MemorySource of_task = source;
      options.part = Part{i, parts};
      convert_quietly(of_task, out, options);
    }
  }
  ConvertReport join(const MemorySource& source, const fs::path& out, ConvertOptions options,
                     std::uint32_t parts) {
    MemorySource of_task = source;
    options.join = parts;
    return convert_quietly(of_task, out, options);
  }
  void expect_same_store(const MemorySource& source, const ConvertOptions& options,
                         std::uint32_t parts) {
    SCOPED_TRACE(std::to_string(parts) + " parts");
    const fs::path one = folder_ / ("a/" + std::to_string(++next_) + ".zarr");
    const fs::path joined = folder_ / ("b/" + std::to_string(next_) + ".zarr");
    MemorySource alone = source;
    const ConvertReport expected = convert_quietly(alone, one, options);
    convert_parts(source, joined, options, parts);
    const ConvertReport report = join(source, joined, options, parts);
    EXPECT_EQ(report.bricks, expected.bricks);
    EXPECT_EQ(report.bricks_absent, expected.bricks_absent);
    EXPECT_EQ(report.bytes_out, expected.bytes_out);
    EXPECT_EQ(report.levels, expected.levels);
    const auto expected_files = tree_of(one), files = tree_of(joined);
    ASSERT_EQ(files.size(), expected_files.size());
    for (const auto& [name, bytes] : expected_files) {
      ASSERT_TRUE(files.contains(name)) << name;
      EXPECT_TRUE(files.at(name) == bytes) << name;
    }
    EXPECT_FALSE(fs::exists(joined.string() + ".parts"));
    EXPECT_FALSE(fs::exists(joined.string() + ".partial"));
  }
  void SetUp() override {
    fs::create_directory(folder_ / "a");
    fs::create_directory(folder_ / "b");
  }

  TemporaryFolder folder_;
  int next_ = 0;
};

TEST_F(ConvertParts, BecomeTheStoreOfASingleConversion) {
  const ConvertOptions small{.brick = 32, .shard = 512};
  // Several units along every axis.
  const auto source = make_source<std::uint8_t>({520, 515, 600}, 3);
  for (const std::uint32_t parts : {1u, 3u, 20u}) expect_same_store(source, small, parts);
}

TEST_F(ConvertParts, OfEveryTypeAndLayout) {
  const Int3 extent{1030, 40, 21};
  expect_same_store(make_source<float>(extent, 1, true), {.brick = 16, .shard = 64}, 3);
  expect_same_store(make_source<double>(extent, 1, true), {.brick = 32, .shard = 32}, 2);
  expect_same_store(make_source<std::int16_t>(extent, 2), {.brick = 48, .shard = 96}, 2);
  expect_same_store(make_source<std::uint32_t>(extent, 2), {.levels = 1}, 2);
  expect_same_store(make_source<std::uint8_t>(extent, 2), {.brick = 16, .ome = OmeVersion::v04}, 2);
  expect_same_store(make_source<std::uint8_t>(extent, 2),
                    {.brick = 16, .codec = BrickCodec::packed}, 3);
  expect_same_store(make_source<std::uint16_t>(extent, 4),
                    {.brick = 32, .downsampling = Downsampling::max, .index = IndexKind::octree},
                    3);
  expect_same_store(make_source<std::uint8_t>({3, 1500, 5}, 4), {}, 2);
}

/// Absent bricks and shards, missing and infinite samples.
TEST_F(ConvertParts, WithLittleInThem) {
  MemorySource source = make_source<float>({1100, 33, 600}, 1);
  std::vector<float> samples(1100 * 33 * 600);
  for (std::size_t i = 0; i < 1000; ++i) samples[i * 7] = static_cast<float>(i) - 500;
  samples[20000] = std::numeric_limits<float>::quiet_NaN();
  samples[30000] = std::numeric_limits<float>::infinity();
  const MemorySource sparse({1100, 33, 600}, ScalarType::f32, as_bytes(samples));
  expect_same_store(sparse, {.brick = 32, .shard = 128}, 4);
  const MemorySource empty({1100, 33, 600}, ScalarType::u8,
                           std::vector<std::byte>(1100 * 33 * 600));
  expect_same_store(empty, {.brick = 32, .shard = 128}, 4);
}

TEST_F(ConvertParts, ThatAreWholeAreKept) {
  const auto source = make_source<std::uint8_t>({1100, 40, 40}, 3);
  const ConvertOptions options{.brick = 16, .shard = 64, .part = Part{1, 2}};
  const fs::path out = folder_ / "s.zarr", part = folder_ / "s.zarr.parts/1of2";
  MemorySource first = source, again = source, damaged = source;
  const ConvertReport made = convert_quietly(first, out, options);
  EXPECT_EQ(made.bricks_kept, 0u);
  const auto files = tree_of(part);
  const ConvertReport kept = convert_quietly(again, out, options);
  EXPECT_EQ(kept.bricks_kept, made.bricks - made.bricks_absent);
  EXPECT_EQ(tree_of(part), files);
  // A shard or a unit that is cut off is made again.
  for (const char* kind : {"0/c/", "units/"}) {
    const auto cut = std::find_if(files.begin(), files.end(),
                                  [&](const auto& file) { return file.first.starts_with(kind); });
    ASSERT_NE(cut, files.end()) << kind;
    std::ofstream(part / cut->first, std::ios::binary) << cut->second.substr(0, 40);
    MemorySource task = source;
    EXPECT_LT(convert_quietly(task, out, options).bricks_kept, kept.bricks_kept) << kind;
    EXPECT_EQ(tree_of(part), files) << kind;
  }
}

TEST_F(ConvertParts, OfAnInputThatHasChangedAreMadeAgain) {
  const Int3 extent{1100, 40, 40};
  auto samples = make_samples<std::uint8_t>(extent, 3);
  const MemorySource before(extent, ScalarType::u8, as_bytes(samples));
  samples[static_cast<std::size_t>(linear_index({700, 20, 20}, extent))] ^= 1;
  // Of the next unit, whose first layer belongs to the ranges of this one.
  samples[static_cast<std::size_t>(linear_index({512, 3, 3}, extent))] ^= 1;
  const MemorySource after(extent, ScalarType::u8, as_bytes(samples));
  const ConvertOptions options{.brick = 16, .shard = 64};
  convert_parts(before, folder_ / "s.zarr", options, 2);
  convert_parts(after, folder_ / "s.zarr", options, 2);
  join(after, folder_ / "s.zarr", options, 2);
  MemorySource alone = after;
  convert_quietly(alone, folder_ / "one.zarr", options);
  EXPECT_EQ(tree_of(folder_ / "s.zarr"), tree_of(folder_ / "one.zarr"));
}

TEST_F(ConvertParts, AreJoinedOnlyWhenAllAreThere) {
  const auto source = make_source<std::uint8_t>({1600, 40, 40}, 3);
  const ConvertOptions options{.brick = 16, .shard = 64};
  const fs::path out = folder_ / "s.zarr";
  convert_parts(source, out, options, 3);
  const auto refused = [&](const ConvertOptions& others, std::uint32_t parts) {
    try {
      join(source, out, others, parts);
    } catch (const UsageError& error) {
      return std::string(error.what());
    }
    ADD_FAILURE() << "joined";
    return std::string();
  };
  EXPECT_NE(refused(options, 4).find("no whole parts 1, 2, 4;"), std::string::npos);
  ConvertOptions other = options;
  other.zstd_level = 5;
  EXPECT_NE(refused(other, 3).find("1, 2, 3"), std::string::npos);
  fs::remove_all(folder_ / "s.zarr.parts/2of3/units");
  EXPECT_NE(refused(options, 3).find("no whole part 2;"), std::string::npos);
  EXPECT_FALSE(fs::exists(out));
  ConvertOptions again = options;
  again.part = Part{2, 3};
  MemorySource task = source;
  convert_quietly(task, out, again);
  join(source, out, options, 3);
  EXPECT_TRUE(fs::exists(out));
}

/// A join that ended after some shards were moved goes on.
TEST_F(ConvertParts, GoOnWithAnInterruptedJoin) {
  const auto source = make_source<std::uint8_t>({1100, 520, 40}, 3);
  const ConvertOptions options{.brick = 16, .shard = 64};
  const fs::path one = folder_ / "a/s.zarr", out = folder_ / "b/s.zarr";
  MemorySource alone = source;
  convert_quietly(alone, one, options);
  convert_parts(source, out, options, 2);
  class Ends final : public Progress {
   public:
    void begin(std::string_view, std::uint64_t) override { throw Error("ended"); }
    void advance(std::uint64_t) override {}
    void end() override {}
  } ends;
  ConvertOptions joining = options;
  joining.join = 2;
  MemorySource task = source;
  EXPECT_THROW(convert(task, out, joining, ends), Error);
  EXPECT_FALSE(fs::exists(out));
  join(source, out, options, 2);
  EXPECT_EQ(tree_of(out), tree_of(one));
}

TEST_F(ConvertParts, RefuseWhatCannotBeDivided) {
  ConvertOptions options{.brick = 16, .part = Part{3, 2}};
  auto source = make_source<std::uint8_t>({1100, 40, 40}, 3);
  EXPECT_THROW(convert_quietly(source, folder_ / "s.zarr", options), UsageError);
  options.part = Part{1, 2};
  auto stream = make_source<std::uint8_t>({1100, 40, 40}, 3, false, false);
  EXPECT_THROW(convert_quietly(stream, folder_ / "s.zarr", options), UsageError);
  options.brick = 20;
  options.shard = 100;
  EXPECT_THROW(convert_quietly(source, folder_ / "s.zarr", options), UsageError);
  options.brick = 16;
  fs::create_directory(folder_ / "s.zarr");
  EXPECT_THROW(convert_quietly(source, folder_ / "s.zarr", options), UsageError);
  fs::remove(folder_ / "s.zarr");
  options.memory = std::uint64_t{1} << 20;
  EXPECT_THROW(convert_quietly(source, folder_ / "s.zarr", options), UsageError);
}

}  // namespace
}  // namespace isobrick::test
