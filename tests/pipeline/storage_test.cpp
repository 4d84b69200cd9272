#include <isobrick/storage.h>

#include <gtest/gtest.h>

#include <isobrick/export.h>
#include <isobrick/histogram.h>
#include <isobrick/open_source.h>
#include <isobrick/open_volume.h>
#include "bricks/stored_index.h"
#include "pipeline/index/add_ranges.h"
#include "tests/bricks/storage/storages.h"
#include "tests/pipeline/index_fixture.h"

// Whole operations on stores that lie in no folder.
namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class StoreInStorage : public ::testing::TestWithParam<std::string> {
 protected:
  StoreInStorage() {
    auto source = make_source<std::uint16_t>({70, 66, 60}, 3);
    convert_quietly(source, folder_ / "a.zarr",
                    {.brick = 16, .shard = 32, .index = IndexKind::octree});
  }
  std::string mesh(const StoreReader& store, const IndexChoice& index) {
    BytesSink sink;
    extract(store, {.isovalue = 30000, .threads = 2, .index = index}, sink, silent_);
    return sink.mesh();
  }

  TemporaryFolder folder_;
  NoProgress silent_;
};

TEST_P(StoreInStorage, GivesTheSameMeshIndexAndHistogram) {
  const StoreReader expected(folder_ / "a.zarr");
  const StoreReader store(make_storage(GetParam(), contents_of(folder_ / "a.zarr"), folder_ / "b"));
  EXPECT_EQ(stored_index_kinds(store, 0), std::vector<std::string>{"octree"});
  EXPECT_EQ(StoredIndex(store, 0, "octree").bytes(), StoredIndex(expected, 0, "octree").bytes());
  const std::string mesh_of_folder = mesh(expected, {});
  EXPECT_NE(mesh_of_folder, "");
  for (const IndexChoice& index : {IndexChoice{}, by(std::nullopt), by(IndexKind::octree)})
    EXPECT_TRUE(mesh(store, index) == mesh_of_folder);
  EXPECT_EQ(stored_histogram(store)->counts, stored_histogram(expected)->counts);
  export_volume(store, folder_ / "x.raw", {}, silent_);
  export_volume(expected, folder_ / "y.raw", {}, silent_);
  EXPECT_TRUE(content_of(folder_ / "x.raw") == content_of(folder_ / "y.raw"));
}

TEST_P(StoreInStorage, AMissingChunkOfAnIndexIsNamed) {
  Contents contents = contents_of(folder_ / "a.zarr");
  const std::string lost = "isobrick/0/index/octree/c/0/0/0";
  ASSERT_EQ(contents.erase(lost), 1u);
  const StoreReader store(make_storage(GetParam(), contents, folder_ / "b"));
  EXPECT_EQ(message_of([&] { mesh(store, by(IndexKind::octree)); }),
            "'" + store.storage()->name_of(lost) + "' is missing");
}

INSTANTIATE_TEST_SUITE_P(Kinds, StoreInStorage, ::testing::ValuesIn(storage_kinds()),
                         [](const auto& kind) { return kind.param; });

class Zip : public ::testing::Test {
 protected:
  Zip() {
    auto source = make_source<std::uint16_t>({40, 36, 33}, 3);
    convert_quietly(source, folder_ / "a.zarr", {.brick = 16, .shard = 32});
  }
  /// A zip of the store, without what lies below `left_out`.
  std::string zip(const std::string& left_out = "nothing") {
    Contents contents = contents_of(folder_ / "a.zarr");
    std::erase_if(contents, [&](const auto& entry) { return entry.first.starts_with(left_out); });
    const fs::path file = folder_ / "a.zarr.zip";
    std::ofstream(file, std::ios::binary) << zip_of(contents);
    return file.string();
  }

  TemporaryFolder folder_;
  NoProgress silent_;
};

TEST_F(Zip, IsVerified) {
  const VerifyReport folder = verify_quietly(folder_ / "a.zarr"), whole = verify_quietly(zip());
  EXPECT_EQ(whole.damage_count, 0u);
  EXPECT_EQ(whole.bricks, folder.bricks);
  EXPECT_GT(whole.bytes, 0u);
  std::string bytes = content_of(folder_ / "a.zarr.zip");
  const std::size_t at = bytes.find("0/c/0/0/0") + 100;
  bytes[at] = static_cast<char>(bytes[at] ^ 1);
  std::ofstream(folder_ / "a.zarr.zip", std::ios::binary) << bytes;
  const VerifyReport damaged = verify_quietly(folder_ / "a.zarr.zip");
  ASSERT_EQ(damaged.damage_count, 1u);
  EXPECT_NE(damaged.damages[0].find("a.zarr.zip:/0/c/0/0/0' at "), std::string::npos)
      << damaged.damages[0];
}

TEST_F(Zip, CannotBeChanged) {
  const std::string file = zip(), before = content_of(file);
  for (const std::string& message :
       {message_of([&] { add_index_quietly(file, {}); }),
        message_of([&] { add_missing_ranges(file, {}, std::uint64_t{1} << 30, 1, silent_); })})
    EXPECT_NE(message.find("is a zip, which cannot be changed: unpack it"), std::string::npos)
        << message;
  EXPECT_THROW(export_volume(StoreReader(file), file, {.force = true}, silent_), UsageError);
  EXPECT_TRUE(content_of(file) == before);
}

TEST_F(Zip, IsOpenedInPlaceWhereItHasRanges) {
  OpenOptions options;
  options.cache.folder = folder_ / "cache";
  const std::string file = zip();
  EXPECT_FALSE(OpenedVolume(file, options, silent_).converted());
  EXPECT_EQ(OpenedVolume(file, options, silent_).store().storage()->local_path(), file);
  options.volume.stride = {2, 2, 2};
  EXPECT_TRUE(OpenedVolume(file, options, silent_).converted());
  EXPECT_FALSE(OpenedVolume(file, options, silent_).converted()) << "the store was kept";
  options.volume = {};
  options.volume.type = ScalarType::u8;
  EXPECT_THROW(OpenedVolume(file, options, silent_), UsageError);
}

TEST_F(Zip, WithoutRangesIsConverted) {
  OpenOptions options;
  options.cache.folder = folder_ / "cache";
  const OpenedVolume opened(zip("isobrick/"), options, silent_);
  EXPECT_TRUE(opened.converted());
  EXPECT_EQ(opened.notes().size(), 1u) << "a zip takes no ranges";
  EXPECT_TRUE(samples_of(opened.store(), 0) == samples_of(StoreReader(folder_ / "a.zarr"), 0));
}

TEST_F(Zip, IsNoFileOfAVolume) {
  const std::string file = zip();
  EXPECT_NE(message_of([&] { open_source(file, {}); }).find("is a zip"), std::string::npos);
}

}  // namespace
}  // namespace isobrick::test
