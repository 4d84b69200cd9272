#include <isobrick/open_volume.h>

#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <thread>

#include <nlohmann/json.hpp>

#include <isobrick/convert.h>
#include <isobrick/error.h>
#include <isobrick/open_source.h>
#include "io/bytes/leftovers.h"
#include "tests/pipeline/convert_store.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class OpenVolume : public ::testing::Test {
 protected:
  /// A raw file of noise, whose name describes it.
  std::string raw(const std::string& name, std::uint32_t seed = 1) {
    const fs::path path = folder_ / (name + "_40x30x20_uint16.raw");
    std::string bytes(40 * 30 * 20 * 2, '\0');
    for (char& c : bytes) c = static_cast<char>((seed = seed * 1664525 + 1013904223) >> 24);
    std::ofstream(path, std::ios::binary) << bytes;
    return path.string();
  }
  OpenOptions options(std::uint64_t limit = 1 << 30) const {
    OpenOptions options;
    options.cache = {folder_ / "cache", limit};
    options.threads = 2;
    return options;
  }
  std::size_t entries() const {
    std::size_t count = 0;
    for (const auto& entry : fs::directory_iterator(folder_ / "cache"))
      count += fs::exists(entry.path() / "entry.json") ? 1 : 0;
    return count;
  }

  TemporaryFolder folder_;
  NoProgress silent_;
};

TEST_F(OpenVolume, AFileIsConvertedOnceAsConvertDoes) {
  const std::string file = raw("a");
  {
    const OpenedVolume first(file, options(), silent_);
    EXPECT_TRUE(first.converted());
    ASSERT_EQ(first.notes().size(), 1u);
    EXPECT_NE(first.notes()[0].find("cache"), std::string::npos);
    const auto source = open_source(file, {});
    convert(*source, folder_ / "b.zarr", {.threads = 1}, silent_);
    EXPECT_EQ(tree_of(first.store().storage()->local_path()), tree_of(folder_ / "b.zarr"));
  }
  const OpenedVolume second(file, options(), silent_);
  EXPECT_FALSE(second.converted());
  EXPECT_TRUE(second.notes().empty());
  EXPECT_EQ(second.store().info().levels[0].lattice.extent, (Int3{40, 30, 20}));
  EXPECT_EQ(entries(), 1u);
}

TEST_F(OpenVolume, AnotherContentOrRequestIsAnotherStore) {
  const std::string file = raw("a");
  EXPECT_TRUE(OpenedVolume(file, options(), silent_).converted());
  OpenOptions other = options();
  other.volume.spacing = Vec3d{2, 2, 2};
  EXPECT_TRUE(OpenedVolume(file, other, silent_).converted());
  EXPECT_FALSE(OpenedVolume(file, other, silent_).converted());
  raw("a", 7);
  fs::last_write_time(file, fs::file_time_type::clock::now() + std::chrono::seconds(5));
  const OpenedVolume changed(file, options(), silent_);
  EXPECT_TRUE(changed.converted());
  EXPECT_EQ(entries(), 3u);
}

TEST_F(OpenVolume, AStoreIsReadWhereItIsUnlessAPartIsRequested) {
  const auto source = open_source(raw("a"), {});
  const std::string store = (folder_ / "a.zarr").string();
  convert(*source, store, {.threads = 1}, silent_);
  const OpenedVolume whole(store, options(), silent_);
  EXPECT_FALSE(whole.converted());
  EXPECT_EQ(whole.store().storage()->local_path(), fs::path(store));
  EXPECT_FALSE(fs::exists(folder_ / "cache"));
  OpenOptions strided = options();
  strided.volume.stride = {2, 2, 2};
  const OpenedVolume part(store, strided, silent_);
  EXPECT_TRUE(part.converted());
  EXPECT_EQ(part.store().info().levels[0].lattice.extent, (Int3{20, 15, 10}));
  EXPECT_FALSE(OpenedVolume(store, strided, silent_).converted());
  OpenOptions raw_options = options();
  raw_options.volume.type = ScalarType::u8;
  EXPECT_THROW(OpenedVolume(store, raw_options, silent_), UsageError);
}

TEST_F(OpenVolume, WithoutACacheNothingStays) {
  OpenOptions none = options();
  none.cache.folder.clear();
  fs::path store;
  {
    const OpenedVolume opened(raw("a"), none, silent_);
    store = opened.store().storage()->local_path();
    EXPECT_TRUE(opened.converted());
    EXPECT_TRUE(fs::exists(store));
  }
  EXPECT_FALSE(fs::exists(store.parent_path()));
  EXPECT_FALSE(fs::exists(folder_ / "cache"));
}

TEST_F(OpenVolume, TheLimitRemovesWhatWasUsedLongestAgoButNothingOpen) {
  const std::string a = raw("a", 1), b = raw("b", 2), c = raw("c", 3);
  const OpenedVolume held(a, options(), silent_);
  EXPECT_TRUE(OpenedVolume(b, options(), silent_).converted());
  EXPECT_EQ(entries(), 2u);
  // Each store has at least its noise, 48,000 bytes; a is open, b is not.
  EXPECT_TRUE(OpenedVolume(c, options(100'000), silent_).converted());
  EXPECT_EQ(entries(), 2u);
  EXPECT_FALSE(OpenedVolume(a, options(), silent_).converted());
  EXPECT_TRUE(OpenedVolume(b, options(), silent_).converted()) << "it was removed";
  // With no room at all it still works, and what is open stays until the next one.
  const OpenedVolume now(c, options(1), silent_);
  EXPECT_TRUE(fs::exists(now.store().storage()->local_path()));
}

TEST_F(OpenVolume, ATemporaryStoreThatAKillLeftGoesWithTheNextOne) {
  const fs::path temporary = folder_ / "temporary";
  fs::create_directory(temporary);
  const std::string before = fs::temp_directory_path().string();
  ASSERT_EQ(::setenv("TMPDIR", temporary.c_str(), 1), 0);
  std::string left;
  {
    const Temporary killed = create_temporary_folder((temporary / "isobrick").string());
    left = killed.path;
    fs::create_directories(fs::path(left) / "store.zarr/0");
  }  // its lock ends as with a process
  fs::create_directory(temporary / "isobrick.partial-1-2-mine");
  OpenOptions none = options();
  none.cache.folder.clear();
  {
    const OpenedVolume opened(raw("a"), none, silent_);
    EXPECT_FALSE(fs::exists(left));
    const OpenedVolume beside(raw("b"), none, silent_);
    EXPECT_TRUE(fs::exists(opened.store().storage()->local_path())) << "somebody holds it";
  }
  ::setenv("TMPDIR", before.c_str(), 1);
  EXPECT_EQ(std::distance(fs::directory_iterator(temporary), fs::directory_iterator()), 1)
      << "another one's folder stays, and nothing else";
}

TEST_F(OpenVolume, FoldersOfOthersInTheCacheStay) {
  for (const char* name : {"mine", "mine-0123456789abcde", "mine-0123456789ABCDEF"}) {
    fs::create_directories(folder_ / "cache" / name / "store.zarr");
    for (const char* file : {"lock", "letter", "store.zarr/letter"})
      std::ofstream(folder_ / "cache" / name / file) << "mine";
  }
  // One that has an entry's name, and more in it than an entry has.
  fs::create_directories(folder_ / "cache" / "a-0123456789abcdef");
  for (const char* file : {"lock", "letter"})
    std::ofstream(folder_ / "cache" / "a-0123456789abcdef" / file) << "mine";
  const OpenedVolume opened(raw("a"), options(1), silent_);
  for (const char* name : {"mine", "mine-0123456789abcde", "mine-0123456789ABCDEF"})
    EXPECT_TRUE(fs::exists(folder_ / "cache" / name / "store.zarr/letter")) << name;
  EXPECT_TRUE(fs::exists(folder_ / "cache/a-0123456789abcdef/letter"));
}

TEST_F(OpenVolume, SeveralAtATimeConvertOnce) {
  const std::string file = raw("a");
  std::atomic<int> converted = 0, opened = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i)
    threads.emplace_back([&] {
      NoProgress silent;
      const OpenedVolume volume(file, options(), silent);
      converted += volume.converted() ? 1 : 0;
      opened += volume.store().info().levels[0].lattice.extent == Int3{40, 30, 20} ? 1 : 0;
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(converted, 1);
  EXPECT_EQ(opened, 4);
}

TEST_F(OpenVolume, ADamagedEntryIsMadeAnew) {
  const std::string file = raw("a");
  fs::path store;
  {
    const OpenedVolume first(file, options(), silent_);
    store = first.store().storage()->local_path();
  }
  for (const fs::path& damaged : {store / "0/c/0/0/0", store / "zarr.json", store / "isobrick"}) {
    fs::remove_all(damaged);
    EXPECT_TRUE(OpenedVolume(file, options(), silent_).converted()) << damaged;
    EXPECT_FALSE(OpenedVolume(file, options(), silent_).converted());
  }
  for (const char* text : {"", "[]", "{\"key\": 7}", "{\"key\": \"\", \"bytes\": \"x\"}"}) {
    std::ofstream(store.parent_path() / "entry.json") << text;
    EXPECT_TRUE(OpenedVolume(file, options(), silent_).converted()) << text;
  }
}

TEST_F(OpenVolume, SamplesThatAreReplacedWithTheirOldTimeAreNoticed) {
  const std::string file = raw("a");
  EXPECT_TRUE(OpenedVolume(file, options(), silent_).converted());
  const auto time = fs::last_write_time(file);
  raw("a", 9);
  fs::last_write_time(file, time);
  EXPECT_TRUE(OpenedVolume(file, options(), silent_).converted());
}

TEST_F(OpenVolume, ZarrWithoutRangesIsConvertedAndItsChunksAreWatched) {
  const std::string store = (folder_ / "a.zarr").string();
  convert(*open_source(raw("a"), {}), store, {.threads = 1}, silent_);
  fs::remove_all(fs::path(store) / "isobrick");
  nlohmann::json group = nlohmann::json::parse(content_of(fs::path(store) / "zarr.json"));
  group["attributes"].erase("isobrick");
  std::ofstream(fs::path(store) / "zarr.json") << group.dump();
  EXPECT_TRUE(OpenedVolume(store, options(), silent_).converted());
  EXPECT_FALSE(OpenedVolume(store, options(), silent_).converted());
  const fs::path chunk = fs::path(store) / "0/c/0/0/0";
  const std::string bytes = content_of(chunk);
  std::ofstream(chunk, std::ios::binary) << bytes;  // as another program writes in place
  EXPECT_TRUE(OpenedVolume(store, options(), silent_).converted());
}

/// Breaks off as a cancelled command does.
class Cancelling final : public Progress {
 public:
  void begin(std::string_view, std::uint64_t) override {}
  void advance(std::uint64_t) override { throw std::runtime_error("cancelled"); }
  void end() override {}
};

TEST_F(OpenVolume, WhatIsCancelledIsNoStoreAndGoesOn) {
  const std::string file = raw("a");
  Cancelling cancelling;
  EXPECT_THROW(OpenedVolume(file, options(), cancelling), std::runtime_error);
  EXPECT_EQ(entries(), 0u);
  EXPECT_TRUE(OpenedVolume(file, options(), silent_).converted());
  EXPECT_FALSE(OpenedVolume(file, options(), silent_).converted());
}

TEST_F(OpenVolume, ACacheThatCannotBeMadeIsNamed) {
  const std::string file = raw("a");
  OpenOptions blocked = options();
  blocked.cache.folder = fs::path(file) / "cache";
  try {
    const OpenedVolume opened(file, blocked, silent_);
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("--cache none"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace isobrick::test
