#include <gtest/gtest.h>

#include <isobrick/error.h>
#include <isobrick/index_build.h>
#include <isobrick/verify.h>
#include "bricks/ranges/stored_ranges.h"
#include "tests/pipeline/convert_store.h"

namespace isobrick::inline v0 {
namespace {

using namespace test;

class Verify : public ::testing::Test {
 protected:
  void SetUp() override {
    MemorySource source = make_source<std::uint16_t>({90, 70, 66}, 2);
    ConvertOptions options;
    options.brick = 16;
    options.shard = 48;
    convert_quietly(source, folder_ / "a", options);
  }

  VerifyReport check(int threads = 2) {
    NoProgress progress;
    return verify(folder_ / "a", {.threads = threads}, progress);
  }

  void flip(const std::filesystem::path& file, std::uint64_t offset) {
    std::fstream f(file, std::ios::binary | std::ios::in | std::ios::out);
    f.seekg(static_cast<std::streamoff>(offset));
    const int byte = f.get();
    f.seekp(static_cast<std::streamoff>(offset));
    f.put(static_cast<char>(byte ^ 0x10));
  }

  TemporaryFolder folder_;
};

TEST_F(Verify, NamesADamagedBrickAndNothingElse) {
  const auto place = *StoreReader(folder_ / "a").locate(0, {1, 2, 1});
  flip(folder_ / "a" / place.key, place.offset + place.size / 2);
  const VerifyReport report = check();
  ASSERT_EQ(report.damage_count, 1u);
  EXPECT_NE(report.damages[0].find("level 0"), std::string::npos);
  EXPECT_NE(report.damages[0].find("(1, 2, 1)"), std::string::npos);
  EXPECT_NE(report.damages[0].find((folder_ / "a" / place.key).string()), std::string::npos);
  EXPECT_NE(report.damages[0].find(std::to_string(place.offset)), std::string::npos);
}

TEST_F(Verify, FindsEveryDamagedBrick) {
  const StoreReader store(folder_ / "a");
  for (const Int3 b : {Int3{0, 0, 0}, Int3{4, 3, 2}, Int3{2, 2, 4}}) {
    const auto place = *store.locate(0, b);
    flip(folder_ / "a" / place.key, place.offset);
  }
  EXPECT_EQ(check(1).damage_count, 3u);
  EXPECT_EQ(check(4).damage_count, 3u);
}

/// A stop ends it, and is no damage.
TEST_F(Verify, CanBeCancelled) {
  NoProgress silent;
  add_index(folder_ / "a", {.kind = IndexKind::octree}, silent);
  struct StopAt final : Progress {
    std::string stage;
    std::stop_source stop;
    explicit StopAt(std::string s) : stage(std::move(s)) {}
    void begin(std::string_view name, std::uint64_t) override {
      if (name.find(stage) != std::string_view::npos) stop.request_stop();
    }
    void advance(std::uint64_t) override {}
    void end() override {}
  };
  for (const std::string stage : {"verify", "index"}) {
    StopAt progress(stage);
    EXPECT_THROW(verify(folder_ / "a", {.cancel = progress.stop.get_token()}, progress), Cancelled)
        << stage;
  }
  EXPECT_EQ(check().damage_count, 0u);
}

TEST_F(Verify, CountsABrokenShardIndexOnce) {
  const auto file = folder_ / "a" / StoreReader(folder_ / "a").locate(0, {0, 0, 0})->key;
  flip(file, std::filesystem::file_size(file) - 20);
  EXPECT_EQ(check().damage_count, 1u);
}

TEST_F(Verify, NoticesAMissingShardByItsRanges) {
  std::filesystem::remove(folder_ / "a" / StoreReader(folder_ / "a").locate(0, {0, 0, 0})->key);
  EXPECT_GT(check().damage_count, 0u);
}

TEST_F(Verify, ComparesRangesWithSamples) {
  // The same volume but for one sample: its ranges beside the old bricks and their checksums.
  std::vector<std::byte> samples = make_source<std::uint16_t>({90, 70, 66}, 2).samples();
  std::memset(samples.data() + 2 * linear_index({40, 33, 20}, {90, 70, 66}), 0xff, 2);
  MemorySource changed({90, 70, 66}, ScalarType::u16, samples);
  ConvertOptions options;
  options.brick = 16;
  options.shard = 48;
  convert_quietly(changed, folder_ / "b", options);
  StoredRanges ranges = *read_stored_ranges(*folder_storage(folder_ / "a"), "");
  const RangeChecksums other = read_stored_ranges(*folder_storage(folder_ / "b"), "")->levels[0];
  ranges.levels[0].bricks = other.bricks;
  ranges.levels[0].blocks = other.blocks;
  std::ofstream(folder_ / "a" / ranges_file("")) << to_json(ranges);
  for (const char* name : {"isobrick/0/range", "isobrick/0/block_range"}) {
    std::filesystem::remove_all(folder_ / "a" / name);
    std::filesystem::rename(folder_ / "b" / name, folder_ / "a" / name);
  }
  const VerifyReport report = check();
  // The brick and the block that own the sample; it lies on no lower border.
  EXPECT_EQ(report.damage_count, 2u);
}

TEST_F(Verify, ComparesChecksumsOfBricks) {
  std::vector<std::byte> samples = make_source<std::uint16_t>({90, 70, 66}, 2).samples();
  // Two samples in the middle of a brick change places, which no range shows.
  const auto byte_of = [&](Index x) {
    return static_cast<std::size_t>(2 * linear_index({x, 40, 24}, {90, 70, 66}));
  };
  Index x = 36;
  while (x < 44 && samples[byte_of(x)] == samples[byte_of(x + 1)]) ++x;
  ASSERT_LT(x, 44);
  std::swap(samples[byte_of(x)], samples[byte_of(x + 1)]);
  std::swap(samples[byte_of(x) + 1], samples[byte_of(x + 1) + 1]);
  MemorySource changed({90, 70, 66}, ScalarType::u16, samples);
  convert_quietly(changed, folder_ / "b", {.brick = 16, .shard = 48});
  std::filesystem::remove_all(folder_ / "a/0");
  std::filesystem::rename(folder_ / "b/0", folder_ / "a/0");
  const VerifyReport report = check();
  ASSERT_EQ(report.damage_count, 1u);
  EXPECT_NE(report.damages[0].find("(2, 2, 1)"), std::string::npos) << report.damages[0];
}

TEST_F(Verify, ReportsBrokenMetadataAndThrowsWithoutAStore) {
  std::ofstream(folder_ / "a" / "1" / "zarr.json") << "{";
  EXPECT_EQ(check().damage_count, 1u);
  NoProgress progress;
  EXPECT_THROW(verify(folder_ / "nothing", {.threads = 1}, progress), Error);
}

}  // namespace
}  // namespace isobrick
