#include <gtest/gtest.h>

#include <sys/resource.h>

#include <csignal>

#include "isobrick/core/error.h"
#include "isobrick/pipeline/export.h"
#include "tests/pipeline/convert_store.h"

namespace isobrick {
namespace {

using namespace test;

constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;

std::string text_of(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

class Export : public testing::Test {
 protected:
  void SetUp() override {
    ConvertOptions options;
    options.brick = 16;
    options.shard = 48;
    convert_quietly(source_, folder_ / "a", options);
    store_ = std::make_unique<StoreReader>(folder_ / "a");
  }

  std::uint64_t write(int level, std::optional<Box3> roi, bool force = false,
                      std::uint64_t memory = 100 * kMiB) {
    NoProgress progress;
    return export_raw(*store_, level, roi, folder_ / "x.raw", force, memory, 2, progress);
  }

  const Int3 extent_{90, 70, 66};
  TemporaryFolder folder_;
  MemorySource source_ = make_source<float>(extent_, 2, true);
  std::unique_ptr<StoreReader> store_;
};

TEST_F(Export, GivesBackTheInputBitForBit) {
  EXPECT_EQ(write(0, std::nullopt), source_.samples().size());
  EXPECT_EQ(content_of(folder_ / "x.raw"), text_of(source_.samples()));
  write(1, std::nullopt, true);
  EXPECT_EQ(content_of(folder_ / "x.raw"), text_of(samples_of(*store_, 1)));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "x.raw.partial"));
}

TEST_F(Export, CutsRegionsWhateverTheBudget) {
  for (const Box3 roi : {Box3{{3, 20, 15}, {80, 21, 50}}, Box3{{16, 16, 16}, {32, 32, 32}},
                         Box3{{89, 69, 65}, {90, 70, 66}}, Box3{{0, 0, 0}, extent_}}) {
    std::vector<std::byte> expected(bytes_of(roi.extent(), ScalarType::f32));
    copy_box(source_.samples().data(), extent_, 4, roi, expected.data());
    for (const std::uint64_t memory : {41 * kMiB, 41 * kMiB + 70000, 200 * kMiB}) {
      write(0, roi, true, memory);
      ASSERT_EQ(content_of(folder_ / "x.raw"), text_of(expected));
    }
  }
}

TEST_F(Export, RefusesWhatMakesNoSense) {
  EXPECT_THROW(write(9, std::nullopt), UsageError);
  EXPECT_THROW(write(-1, std::nullopt), UsageError);
  EXPECT_THROW(write(0, Box3{{0, 0, 0}, {91, 1, 1}}), UsageError);
  EXPECT_THROW(write(0, Box3{{5, 5, 5}, {5, 6, 6}}), UsageError);
  EXPECT_THROW(write(0, std::nullopt, false, kMiB), UsageError);
  std::ofstream(folder_ / "x.raw") << "precious";
  EXPECT_THROW(write(0, std::nullopt), UsageError);
  EXPECT_EQ(content_of(folder_ / "x.raw"), "precious");
}

TEST_F(Export, LeavesNothingWhenABrickIsDamaged) {
  const auto place = *store_->locate(0, {1, 1, 1});
  std::fstream f(place.file, std::ios::binary | std::ios::in | std::ios::out);
  f.seekp(static_cast<std::streamoff>(place.offset));
  f << "????";
  f.close();
  EXPECT_THROW(write(0, std::nullopt), DamageError);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "x.raw"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "x.raw.partial"));
}

TEST_F(Export, LeavesNothingWhenThereIsNoRoom) {
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit small = before;
  small.rlim_cur = 100000;
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  EXPECT_THROW(write(0, std::nullopt), Error);
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "x.raw"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "x.raw.partial"));
}

}  // namespace
}  // namespace isobrick
