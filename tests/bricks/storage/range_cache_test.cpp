#include "bricks/storage/range_cache.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <thread>

#include <isobrick/error.h>
#include "bricks/storage/cached_object.h"
#include "bricks/storage/remote_storage.h"
#include "tests/bricks/storage/fake_client.h"

namespace isobrick {
namespace {

namespace fs = std::filesystem;
using test::Bytes;
using test::FakeClient;
using test::noise;

class RangeCacheTest : public testing::Test {
 protected:
  static constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;

  RangeCacheTest() {
    std::string name = (fs::temp_directory_path() / "isobrick-cache-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
    client_->objects["http://host/x.zarr/large"] = large_;
    client_->objects["http://host/x.zarr/small"] = noise(100);
  }
  ~RangeCacheTest() override { fs::remove_all(folder_); }

  std::shared_ptr<RangeCache> cache(std::uint64_t limit = 64 * kMiB) {
    return std::make_shared<RangeCache>(
        folder_, limit, [this](const std::string& note) { notes_.push_back(note); });
  }
  /// A storage of another process, as far as it can tell.
  std::shared_ptr<const Storage> open(std::uint64_t limit = 64 * kMiB) {
    RemoteOptions options;
    options.memory = 4 * kMiB;
    options.cache_folder = folder_;
    options.cache_limit = limit;
    options.on_note = [this](const std::string& note) { notes_.push_back(note); };
    return remote_storage("http://host/x.zarr", options, client_);
  }
  Bytes read(const StoredObject& object, std::uint64_t offset, std::size_t size) {
    Bytes bytes(size);
    object.read(offset, bytes);
    return bytes;
  }
  Bytes part(std::uint64_t offset, std::size_t size) const {
    const auto begin = large_.begin() + static_cast<std::ptrdiff_t>(offset);
    return {begin, begin + static_cast<std::ptrdiff_t>(size)};
  }
  std::size_t requests() { return client_->take_ranges().size(); }
  /// The files of ranges.
  std::vector<fs::path> ranges() const {
    std::vector<fs::path> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder_))
      if (entry.is_regular_file() && entry.path().filename() != "total" &&
          entry.path().filename() != "state.json")
        files.push_back(entry.path());
    return files;
  }
  std::uint64_t bytes_on_disk() const {
    std::uint64_t bytes = 0;
    for (const auto& entry : fs::recursive_directory_iterator(folder_))
      if (entry.is_regular_file()) bytes += entry.file_size();
    return bytes;
  }

  const Bytes large_ = noise(10 * kMiB);
  const ObjectState state_{10 * kMiB, "\"1\"", "Sat, 28 Nov 2026 00:00:00 GMT"};
  std::shared_ptr<FakeClient> client_ = std::make_shared<FakeClient>();
  std::vector<std::string> notes_;
  fs::path folder_;
};

TEST_F(RangeCacheTest, RangesComeBack) {
  const auto disk = cache();
  {
    const CachedObject object(disk, "u", state_);
    EXPECT_EQ(object.missing(0, 100), 100u);
    object.write(1000, part(1000, 200000));
    object.write(300000, part(300000, 10));
  }
  const CachedObject object(cache(), "u", state_);
  EXPECT_EQ(object.missing(0, 5000), 1000u);
  EXPECT_EQ(object.missing(1000, 5000), 0u);
  EXPECT_TRUE(object.has(1000, 200000));
  EXPECT_FALSE(object.has(1000, 200001));
  EXPECT_FALSE(object.has(999, 2));
  // Within a block, over its border, to the end of the range and beyond.
  for (const auto& [offset, size, count] :
       {std::tuple<std::uint64_t, std::size_t, std::size_t>{1000, 10, 10},
        {60000, 20000, 20000},
        {1000, 200000, 200000},
        {66536, 65536, 65536},
        {200999, 100, 1},
        {300000, 11, 10},
        {201000, 1, 0},
        {999, 5, 0}}) {
    Bytes bytes(size);
    ASSERT_EQ(object.read(offset, bytes), count) << offset;
    bytes.resize(count);
    EXPECT_EQ(bytes, part(offset, count)) << offset;
  }
  // Of another object and of another state there is nothing.
  EXPECT_FALSE(CachedObject(cache(), "v", state_).has(1000, 1));
  ObjectState other = state_;
  other.last_modified = "later";
  EXPECT_FALSE(CachedObject(cache(), "u", other).has(1000, 1));
  // … and what is there of an older one goes.
  EXPECT_TRUE(ranges().empty());
}

TEST_F(RangeCacheTest, RangesMayOverlap) {
  const std::vector<std::pair<std::uint64_t, std::size_t>> ranges{
      {5000, 100}, {1000, 8000}, {1000, 20000}, {500, 700}, {20900, 1000}, {0, 30000}};
  for (std::size_t count = 1; count <= ranges.size(); ++count) {
    fs::remove_all(folder_ / "remote");
    for (std::size_t i = 0; i < count; ++i)
      CachedObject(cache(), "u", state_)
          .write(ranges[i].first, part(ranges[i].first, ranges[i].second));
    const CachedObject object(cache(), "u", state_);
    for (std::size_t i = 0; i < count; ++i) {
      ASSERT_TRUE(object.has(ranges[i].first, ranges[i].second)) << i << " of " << count;
      Bytes bytes(ranges[i].second);
      for (std::size_t at = 0; at < bytes.size();) {
        const std::size_t read = object.read(ranges[i].first + at, std::span(bytes).subspan(at));
        ASSERT_GT(read, 0u);
        at += read;
      }
      EXPECT_EQ(bytes, part(ranges[i].first, ranges[i].second));
    }
  }
}

TEST_F(RangeCacheTest, DamagedFilesAreNotThere) {
  for (const auto change : {0, 1, 2, 3}) {
    CachedObject(cache(), "u", state_).write(0, part(0, 200000));
    ASSERT_EQ(ranges().size(), 1u);
    const fs::path file = ranges().front();
    if (change == 0) fs::resize_file(file, 150000);
    if (change == 1) fs::resize_file(file, 0);
    if (change >= 2) {
      std::fstream stream(file, std::ios::in | std::ios::out | std::ios::binary);
      stream.seekp(change == 2 ? 150000 : 5);  // in a block, in the checksums
      stream.put('x').put('y');
    }
    const CachedObject object(cache(), "u", state_);
    Bytes bytes(200000);
    EXPECT_EQ(object.read(0, bytes), 0u) << change;
    EXPECT_TRUE(ranges().empty()) << change;
    EXPECT_FALSE(object.has(0, 1)) << change;
  }
}

TEST_F(RangeCacheTest, WhatWasUsedLongestAgoGoes) {
  const auto disk = cache(2 * kMiB);
  const CachedObject object(disk, "u", state_);
  const auto age = [&](std::chrono::seconds seconds) {
    for (const fs::path& file : ranges())
      fs::last_write_time(file, fs::last_write_time(file) - seconds);
  };
  constexpr std::uint64_t kSize = 300000;
  for (std::uint64_t i = 0; i < 6; ++i) {
    object.write(i * kSize, part(i * kSize, kSize));
    age(std::chrono::hours(1));
  }
  EXPECT_EQ(ranges().size(), 6u);
  // The oldest is used again, by another process.
  const CachedObject again(cache(2 * kMiB), "u", state_);
  Bytes bytes(10);
  ASSERT_EQ(again.read(5, bytes), 10u);
  object.write(6 * kSize, part(6 * kSize, kSize));
  const CachedObject later(cache(2 * kMiB), "u", state_);
  EXPECT_TRUE(later.has(0, kSize));
  EXPECT_FALSE(later.has(kSize, 1));
  EXPECT_TRUE(later.has(2 * kSize, 5 * kSize));
  EXPECT_LE(bytes_on_disk(), 2 * kMiB);
  // A smaller limit holds at once.
  cache(kMiB);
  EXPECT_LE(bytes_on_disk(), kMiB);
  EXPECT_FALSE(ranges().empty());
  EXPECT_TRUE(notes_.empty());
}

TEST_F(RangeCacheTest, TheLimitHoldsForAllWhoWrite) {
  std::vector<std::thread> threads;
  for (std::uint64_t t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      const auto disk = std::make_shared<RangeCache>(folder_, kMiB, nullptr);
      const CachedObject object(disk, std::to_string(t), state_);
      for (std::uint64_t i = 0; i < 50; ++i) {
        const Bytes bytes = part(i * 100000, 50000);
        object.write(i * 100000, bytes);
        Bytes kept(50000);
        if (const std::size_t count = object.read(i * 100000, kept); count > 0) {
          EXPECT_EQ(kept, bytes);
        }
      }
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_LE(bytes_on_disk(), kMiB);
  EXPECT_GT(bytes_on_disk(), kMiB / 2);
}

/// Files count that are still being written when others look for room.
TEST_F(RangeCacheTest, WhatIsBeingWrittenCounts) {
  const Bytes bytes = noise(2 * kMiB);
  for (int round = 0; round < 10; ++round) {
    const auto disk = cache(5 * kMiB);
    std::vector<std::thread> threads;
    for (int t = 0; t < 8; ++t)
      threads.emplace_back([&, t] {
        const fs::path folder = disk->folder_of(std::to_string(t));
        for (int i = 0; i < 4; ++i)
          disk->write(folder / std::to_string(4 * round + i), {std::span<const std::byte>(bytes)});
      });
    for (std::thread& thread : threads) thread.join();
    ASSERT_LE(bytes_on_disk(), 5 * kMiB) << round;
  }
  EXPECT_GE(bytes_on_disk(), bytes.size());
  EXPECT_TRUE(notes_.empty());
}

TEST_F(RangeCacheTest, FilesOfKilledProcessesGo) {
  cache()->put(folder_ / "remote" / "a", {});
  const fs::path old = folder_ / "remote" / "a" / "partial-1-1",
                 fresh = folder_ / "remote" / "a" / "partial-1-2";
  for (const fs::path& file : {old, fresh}) std::ofstream(file) << std::string(600000, 'x');
  fs::last_write_time(old, fs::file_time_type::clock::now() - std::chrono::hours(1));
  fs::remove(folder_ / "remote" / "total");  // counts anew
  cache(kMiB);
  EXPECT_FALSE(fs::exists(old));
  EXPECT_TRUE(fs::exists(fresh));
}

TEST_F(RangeCacheTest, StatesComeBack) {
  const auto disk = cache();
  const fs::path folder = disk->folder_of("u");
  EXPECT_FALSE(disk->find(folder));
  disk->put(folder, {.state = state_, .fresh_until = 12, .root = 99});
  auto found = cache()->find(folder);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->state, state_);
  EXPECT_EQ(found->fresh_until, 12);
  EXPECT_EQ(found->root, 99u);
  disk->put(folder, {.is_missing = true});
  EXPECT_TRUE(disk->find(folder)->is_missing);
  disk->put(folder, {.state = {1, "\xff\"", ""}});  // no UTF-8
  EXPECT_TRUE(disk->find(folder));
  std::ofstream(folder / "state.json") << "{\"missing\":fal";
  EXPECT_FALSE(disk->find(folder));
  disk->put(folder, {});
  disk->forget(folder);
  EXPECT_FALSE(disk->find(folder));
}

TEST_F(RangeCacheTest, BytesAreRequestedOnce) {
  {
    const auto storage = open();
    const auto large = storage->open("large");
    large->will_need(3 * kMiB, 5000);
    client_->settle();
    EXPECT_EQ(read(*large, 3 * kMiB, 5000), part(3 * kMiB, 5000));
    EXPECT_EQ(read(*large, 5 * kMiB, 5000000), part(5 * kMiB, 5000000));
    EXPECT_EQ(read(*large, 0, 1000), part(0, 1000));
    EXPECT_EQ(read(*storage->open("small"), 0, 100), noise(100));
    EXPECT_EQ(storage->open("none"), nullptr);
  }
  EXPECT_GT(requests(), 5u);
  int unchanged = 0;
  client_->change = [&](const HttpRequest&, const HttpReply& reply) {
    unchanged += reply.status == 304;
  };
  const auto storage = open();
  const auto large = storage->open("large");
  large->will_need(3 * kMiB, 5000);
  EXPECT_EQ(read(*large, 3 * kMiB + 100, 4900), part(3 * kMiB + 100, 4900));
  EXPECT_EQ(read(*large, 5 * kMiB, 5000000), part(5 * kMiB, 5000000));
  EXPECT_EQ(read(*large, 0, 1000), part(0, 1000));
  EXPECT_EQ(read(*storage->open("small"), 0, 100), noise(100));
  EXPECT_EQ(storage->open("none"), nullptr);
  EXPECT_EQ(requests(), 3u);  // one of each object, whether it is still the same
  EXPECT_EQ(unchanged, 2);
  client_->change = {};
  // What is missing between two ranges, and no more.
  EXPECT_EQ(read(*large, 3 * kMiB, 4 * kMiB), part(3 * kMiB, 4 * kMiB));
  std::uint64_t bytes = 0;
  for (const ByteRange& range : client_->take_ranges()) bytes += range.size;
  EXPECT_EQ(bytes, 2 * kMiB - 5000);
}

TEST_F(RangeCacheTest, AnObjectThatChangedIsFetchedAnew) {
  EXPECT_EQ(read(*open()->open("large"), kMiB, 1000), part(kMiB, 1000));
  const Bytes other(10 * kMiB, std::byte{7});
  client_->objects["http://host/x.zarr/large"] = other;
  client_->etag = "\"2\"";
  EXPECT_EQ(read(*open()->open("large"), kMiB, 1000), Bytes(1000, std::byte{7}));
  // … while it is open: an error, as without a cache.
  const auto large = open()->open("large");
  client_->etag = "\"3\"";
  EXPECT_THROW(read(*large, 3 * kMiB, 10), Error);
  EXPECT_EQ(read(*open()->open("large"), 3 * kMiB, 10), Bytes(10, std::byte{7}));
}

TEST_F(RangeCacheTest, WhatMustNotBeKeptIsNot) {
  client_->change = [](const HttpRequest&, HttpReply& reply) {
    reply.headers["cache-control"] = "private, no-store";
  };
  read(*open()->open("large"), kMiB, 1000);
  EXPECT_TRUE(ranges().empty());
  // Without a state nobody can tell whether bytes are still those of the object.
  client_->change = [](const HttpRequest&, HttpReply& reply) { reply.headers.erase("etag"); };
  read(*open()->open("large"), kMiB, 1000);
  EXPECT_TRUE(ranges().empty());
  client_->change = {};
  read(*open(0)->open("large"), kMiB, 1000);
  EXPECT_TRUE(ranges().empty());
}

TEST_F(RangeCacheTest, AFolderThatCannotBeWrittenIsNoted) {
  std::ofstream(folder_ / "remote") << "no folder";
  EXPECT_EQ(read(*open()->open("large"), kMiB, 1000), part(kMiB, 1000));
  ASSERT_EQ(notes_.size(), 1u);
  EXPECT_NE(notes_[0].find(folder_.string() + "/remote"), std::string::npos) << notes_[0];
}

}  // namespace
}  // namespace isobrick
