#include <gtest/gtest.h>

#include <sys/resource.h>
#include <sys/stat.h>

#include <algorithm>
#include <csignal>
#include <thread>

#include <isobrick/error.h>
#include <isobrick/export.h>
#include "pipeline/program_memory.h"
#include "tests/pipeline/convert_store.h"

namespace isobrick::inline v0 {
namespace {

using namespace test;

std::string text_of(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

class Export : public ::testing::Test {
 protected:
  void SetUp() override {
    ConvertOptions options;
    options.brick = 16;
    options.shard = 48;
    convert_quietly(source_, folder_ / "a", options);
    store_ = std::make_unique<StoreReader>(folder_ / "a");
  }

  void write(int level, std::optional<Box3> roi, bool force = false,
             std::uint64_t memory = 100 * kMiB) {
    NoProgress progress;
    export_volume(*store_, folder_ / "x.raw",
                  {.level = level, .roi = roi, .force = force, .memory = memory, .threads = 2},
                  progress);
  }

  std::vector<std::string> files() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / "."))
      names.push_back(entry.path().filename().string());
    std::sort(names.begin(), names.end());
    return names;
  }

  const Int3 extent_{90, 70, 66};
  TemporaryFolder folder_;
  MemorySource source_ = make_source<float>(extent_, 2, true);
  std::unique_ptr<StoreReader> store_;
};

TEST_F(Export, GivesBackTheInputBitForBit) {
  write(0, std::nullopt);
  EXPECT_EQ(content_of(folder_ / "x.raw"), text_of(source_.samples()));
  write(1, std::nullopt, true);
  EXPECT_EQ(content_of(folder_ / "x.raw"), text_of(samples_of(*store_, 1)));
  EXPECT_EQ(files(), (std::vector<std::string>{"a", "x.nhdr", "x.raw"}));
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

TEST_F(Export, TouchesNothingButItsOwnFile) {
  namespace fs = std::filesystem;
  std::ofstream(folder_ / "x.raw.partial") << "precious";
  write(0, std::nullopt);
  EXPECT_EQ(content_of(folder_ / "x.raw.partial"), "precious");
  fs::remove(folder_ / "x.raw.partial");
  std::ofstream(folder_ / "other") << "precious";
  fs::create_symlink(folder_ / "other", folder_ / "x.raw.partial");
  write(0, std::nullopt, true);
  EXPECT_EQ(content_of(folder_ / "other"), "precious");
  // A link is replaced, not followed; a pipe stays what it is.
  fs::remove(folder_ / "x.raw");
  fs::create_symlink(folder_ / "other", folder_ / "x.raw");
  EXPECT_THROW(write(0, std::nullopt), UsageError);
  write(0, std::nullopt, true);
  EXPECT_EQ(content_of(folder_ / "other"), "precious");
  EXPECT_EQ(content_of(folder_ / "x.raw"), text_of(source_.samples()));
  fs::remove(folder_ / "x.raw");
  ASSERT_EQ(::mkfifo((folder_ / "x.raw").c_str(), 0600), 0);
  EXPECT_THROW(write(0, std::nullopt, true), UsageError);
  EXPECT_TRUE(fs::is_fifo(folder_ / "x.raw"));
}

TEST_F(Export, SeveralAtATimeEachWriteTheirOwn) {
  const auto write_often = [&] {
    NoProgress none;
    for (int i = 0; i < 10; ++i)
      export_volume(*store_, folder_ / "x.raw", {.force = true, .memory = 100 * kMiB, .threads = 1},
                    none);
  };
  std::thread other(write_often);
  write_often();
  other.join();
  EXPECT_EQ(content_of(folder_ / "x.raw"), text_of(source_.samples()));
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

TEST_F(Export, TheGridAndTheDecodersShareOneBudget) {
  MemorySource noise = make_source<float>({128, 128, 128}, 3);
  ConvertOptions options;
  options.brick = options.shard = 128;
  options.levels = 1;
  convert_quietly(noise, folder_ / "b", options);
  const StoreReader store(folder_ / "b");
  NoProgress progress;
  const auto write_grid = [&](std::uint64_t memory) {
    export_volume(store, folder_ / "b.vdb",
                  {.format = ExportFormat::vdb, .memory = memory, .threads = 2}, progress);
  };
  // A brick of 8 MiB, four for the decoders; then another one for the grid.
  try {
    write_grid(65 * kMiB);
    FAIL() << "the grid was not counted";
  } catch (const UsageError& e) {
    const std::string what = e.what();
    if (what.find("built without") != std::string::npos) GTEST_SKIP() << what;
    EXPECT_NE(what.find("a memory budget of 65.0 MiB is too small"), std::string::npos) << what;
    EXPECT_NE(what.find("9.3 MiB of it for the grid"), std::string::npos) << what;
  }
  EXPECT_FALSE(std::filesystem::exists(folder_ / "b.vdb"));
  write_grid(140 * kMiB);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "b.vdb"));
}

TEST_F(Export, LeavesNothingWhenABrickIsDamaged) {
  const auto place = *store_->locate(0, {1, 1, 1});
  std::fstream f(folder_ / "a" / place.key, std::ios::binary | std::ios::in | std::ios::out);
  f.seekp(static_cast<std::streamoff>(place.offset));
  f << "????";
  f.close();
  EXPECT_THROW(write(0, std::nullopt), DamageError);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "x.raw"));
  EXPECT_EQ(files(), std::vector<std::string>{"a"});
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
  EXPECT_EQ(files(), std::vector<std::string>{"a"});
}

}  // namespace
}  // namespace isobrick
