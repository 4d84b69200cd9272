#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <map>

#include "tests/bricks/store_fixture.h"

namespace isobrick::test {
namespace {

using Tree = std::map<std::string, std::string>;

Tree tree(const std::filesystem::path& root) {
  Tree files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(root))
    if (entry.is_regular_file())
      files[std::filesystem::relative(entry.path(), root).string()] = read_file(entry.path());
  return files;
}

class Resume : public testing::Test {
 protected:
  std::vector<Level> levels = {make_level(ScalarType::u16, {70, 50, 90}, 16, 32, 3, true),
                               make_level(ScalarType::u16, {35, 25, 45}, 16, 32, 3, true)};
  StoreLayout layout = make_layout(levels, 3, 3);
  TemporaryFolder folder;

  std::vector<std::pair<int, Int3>> shards() const {
    std::vector<std::pair<int, Int3>> all;
    for (int i = 0; i < 2; ++i)
      for_each_point({{0, 0, 0}, shards_of(levels[static_cast<std::size_t>(i)])},
                     [&](Int3 s) { all.emplace_back(i, s); });
    return all;
  }

  /// Goes on to the end; the number of shards that were kept.
  int complete(const std::filesystem::path& path) {
    StoreWriter writer(path, layout, true);
    int kept = 0;
    for (const auto& [level, s] : shards()) {
      if (writer.shard_is_whole(level, s)) {
        writer.keep_shard(level, s);
        ++kept;
      } else {
        write_shard(writer, levels, level, s, 3, 3);
      }
    }
    write_ranges(writer, levels);
    writer.finish(false);
    return kept;
  }
};

TEST_F(Resume, AfterADeathAnywhere) {
  write_store(folder / "whole.zarr", levels, 3, 3);
  const Tree expected = tree(folder / "whole.zarr");
  const auto all = shards();
  for (std::size_t done = 0; done <= all.size(); done += 3) {
    const std::filesystem::path path = folder / ("died" + std::to_string(done) + ".zarr");
    const pid_t child = fork();
    if (child == 0) {
      // Dies without any cleaning up, with a shard half written.
      StoreWriter writer(path, layout, false);
      for (std::size_t i = 0; i < done; ++i)
        write_shard(writer, levels, all[i].first, all[i].second, 3, 3);
      if (done < all.size()) {
        const auto [level, s] = all[done];
        writer.put(level, s * 2, std::vector<std::byte>(1000));
      } else {
        write_ranges(writer, levels);
      }
      _exit(0);
    }
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_EQ(status, 0);
    try {
      StoreReader store(path);
      FAIL() << "an interrupted conversion was taken for a store";
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find("interrupted"), std::string::npos) << e.what();
    }
    complete(path);
    EXPECT_EQ(tree(path), expected);
  }
}

TEST_F(Resume, KeepsWholeShardsAndRedoesOthers) {
  const std::filesystem::path path = folder / "a.zarr";
  const auto all = shards();
  {
    StoreWriter writer(path, layout, false);
    for (const auto& [level, s] : all) write_shard(writer, levels, level, s, 3, 3);
  }
  write_store(folder / "whole.zarr", levels, 3, 3);
  const Tree expected = tree(folder / "whole.zarr");
  // One shard is cut off, one has a longer tail, one a damaged index.
  const std::string bytes = expected.at("0/c/0/0/0");
  write_file(path / "0/c/0/0/0", bytes.substr(0, bytes.size() / 2));
  write_file(path / "0/c/0/0/1", "x" + expected.at("0/c/0/0/1"));
  std::string damaged = expected.at("0/c/0/1/0");
  damaged[damaged.size() - 20] ^= 1;
  write_file(path / "0/c/0/1/0", damaged);
  EXPECT_EQ(complete(path), static_cast<int>(all.size()) - 3);
  EXPECT_EQ(tree(path), expected);
}

TEST_F(Resume, AnotherLayoutIsRefused) {
  const std::filesystem::path path = folder / "a.zarr";
  { StoreWriter writer(path, layout, false); }
  StoreLayout other = layout;
  other.zstd_level = 4;
  try {
    StoreWriter writer(path, other, true);
    FAIL();
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("another layout"), std::string::npos) << e.what();
    EXPECT_NE(std::string(e.what()).find("level"), std::string::npos) << e.what();
  }
  other = layout;
  other.levels[0].transform.spacing.x = 2;
  EXPECT_THROW(StoreWriter(path, other, true), Error);
  EXPECT_NO_THROW(StoreWriter(path, layout, true));
}

TEST_F(Resume, OnlyWhatWasBegun) {
  // Not over a finished store, not over something else, not without resume.
  write_store(folder / "whole.zarr", levels, 3, 3);
  EXPECT_THROW(StoreWriter(folder / "whole.zarr", layout, true), Error);
  EXPECT_THROW(StoreWriter(folder / "whole.zarr", layout, false), Error);
  write_file(folder / "photos/me.jpg", "smile");
  EXPECT_THROW(StoreWriter(folder / "photos", layout, true), Error);
  EXPECT_EQ(read_file(folder / "photos/me.jpg"), "smile");
  EXPECT_NO_THROW(StoreWriter(folder / "new.zarr", layout, true));
}

TEST_F(Resume, AnUnfinishedShardStopsFinish) {
  StoreWriter writer(folder / "a.zarr", layout, false);
  writer.put(0, {0, 0, 0}, std::vector<std::byte>(10));
  EXPECT_THROW(writer.finish(false), Error);
}

TEST_F(Resume, PartOfTheRangesStopsFinish) {
  StoreWriter writer(folder / "a.zarr", layout, false);
  writer.put_brick_ranges(0, {{0, 0, 0}, {1, 1, 1}}, std::vector<std::byte>(4));
  EXPECT_THROW(writer.finish(false), Error);
  EXPECT_FALSE(std::filesystem::exists(folder / "a.zarr/zarr.json"));
}

TEST_F(Resume, DiskErrorsAreToldWithTheirPath) {
  write_file(folder / "file", "");
  const auto expect_error = [&](const std::string& part, auto&& f) {
    try {
      f();
      FAIL() << "no error";
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
    }
  };
  expect_error("Not a directory", [&] { StoreWriter(folder / "file/a.zarr", layout, false); });
  {
    StoreWriter writer(folder / "full.zarr", layout, false);
    // A limit on the size of files is as good as a full disk.
    signal(SIGXFSZ, SIG_IGN);
    rlimit before{};
    ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
    const rlimit full{16, before.rlim_max};
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &full), 0);
    expect_error("0/c/0/0/0.tmp': File too large", [&] {
      write_shard(writer, levels, 0, {0, 0, 0}, 3, 3);
    });
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  }
  // An error in the background comes out at the latest in finish().
  const std::filesystem::path path = folder / "b.zarr";
  StoreWriter writer(path, layout, false);
  std::filesystem::create_directories(path / "0/c/0/0/0");
  expect_error("0/c/0/0/0", [&] {
    write_shard(writer, levels, 0, {0, 0, 0}, 3, 3);
    writer.finish(false);
  });
  EXPECT_THROW(writer.finish(false), Error);
  EXPECT_FALSE(std::filesystem::exists(path / "zarr.json"));
}

}  // namespace
}  // namespace isobrick::test
