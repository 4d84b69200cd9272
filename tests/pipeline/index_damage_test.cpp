#include <gtest/gtest.h>

#include "bricks/stored_index.h"
#include "index/span_index.h"
#include "tests/pipeline/index_fixture.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class IndexDamage : public ::testing::TestWithParam<IndexKind> {
 protected:
  void SetUp() override {
    MemorySource source = make_source<std::int16_t>({150, 70, 70}, 4);
    convert_quietly(source, store_, {.levels = 1});
    for (const IndexKind kind : kStoredKinds) add_index_quietly(store_, {.kind = kind, .leaf = 8});
    mesh_ = mesh_of(store_, {.isovalue = 5}, std::nullopt);
    for (const auto& [file, bytes] : tree_of(store_ / index_folder("", 0, kind_)))
      files_.push_back(store_ / index_folder("", 0, kind_) / file);
    ASSERT_EQ(files_.size(), 2u);
  }

  /// Reading by this index is refused by a line that names the file, `verify`
  /// finds it, and whatever else is in the store works as before.
  void expect_noticed(const fs::path& file, const std::string& what) {
    const std::string text = message_of([&] { mesh_of(store_, {.isovalue = 5}, GetParam()); });
    EXPECT_NE(text.find(file.string()), std::string::npos) << what << ": " << text;
    const VerifyReport report = verify_quietly(store_);
    ASSERT_GE(report.damage_count, 1u) << what;
    for (const std::string& line : report.damages) {
      EXPECT_NE(line.find(file.string()), std::string::npos) << line;
      EXPECT_NE(line.find(kind_), std::string::npos) << line;
      EXPECT_NE(line.find("level 0"), std::string::npos) << line;
    }
  }

  void write(const fs::path& file, const std::string& bytes) {
    std::ofstream(file, std::ios::binary) << bytes;
  }

  /// The chunk with one part replaced, under right checksums.
  void replace_part(std::size_t part, std::optional<std::vector<std::byte>> content) {
    const StoreReader reader(store_);
    const StoredIndex index(reader, 0, kind_);
    const std::size_t count = index.layout().parts_of_chunk({0, 0, 0});
    std::vector<std::optional<std::vector<std::byte>>> parts(count);
    {
      const IndexChunk chunk = index.open({0, 0, 0});
      for (std::size_t i = 0; i < count; ++i)
        if (std::vector<std::byte> bytes; chunk.read(i, bytes)) parts[i] = bytes;
    }
    parts[part] = std::move(content);
    Publisher publisher(store_);
    IndexChunkWriter writer(publisher,
                            store_ / index_folder("", 0, kind_) / index_chunk_name({0, 0, 0}),
                            count, index.name_of({0, 0, 0}));
    for (std::size_t i = 0; i < count; ++i)
      if (parts[i]) writer.append(i, encode_index_part(3, *parts[i]));
    writer.publish();
    publisher.wait();
  }

  std::vector<std::byte> part(std::size_t i) {
    const StoreReader reader(store_);
    std::vector<std::byte> bytes;
    EXPECT_TRUE(StoredIndex(reader, 0, kind_).open({0, 0, 0}).read(i, bytes));
    return bytes;
  }

  TemporaryFolder folder_;
  fs::path store_ = folder_ / "a";
  std::string kind_{name_of(GetParam())};
  std::string mesh_;
  std::vector<fs::path> files_;
};

TEST_P(IndexDamage, FlippedBytesAreNoticed) {
  for (const fs::path& file : files_) {
    const std::string whole = content_of(file);
    for (std::size_t k = 0; k < 24; ++k) {
      std::string bytes = whole;
      const std::size_t at = k * (whole.size() - 1) / 23;
      if (bytes[at] == ' ' || bytes[at] == '\n') continue;  // of the JSON
      bytes[at] = static_cast<char>(bytes[at] ^ (1 << k % 8));
      write(file, bytes);
      expect_noticed(file, "byte " + std::to_string(at));
    }
    write(file, whole);
  }
  EXPECT_TRUE(mesh_of(store_, {.isovalue = 5}, GetParam()) == mesh_);
}

TEST_P(IndexDamage, CutAndLostFilesAreNoticed) {
  for (const fs::path& file : files_) {
    const std::string whole = content_of(file);
    for (const std::size_t size : {std::size_t{0}, whole.size() / 2, whole.size() - 2}) {
      write(file, whole.substr(0, size));
      expect_noticed(file, "size " + std::to_string(size));
    }
    write(file, whole);
  }
  fs::remove(store_ / index_folder("", 0, kind_) / index_chunk_name({0, 0, 0}));
  expect_noticed(store_ / index_folder("", 0, kind_) / index_chunk_name({0, 0, 0}), "lost");
}

TEST_P(IndexDamage, OtherKindsGoOnWorking) {
  fs::resize_file(files_[0], 40);
  for (const IndexKind kind : kStoredKinds)
    if (kind != GetParam()) {
      EXPECT_TRUE(mesh_of(store_, {.isovalue = 5}, kind) == mesh_);
    }
}

// Under right checksums: what is no such index is refused; what is one, but of
// other ranges, is for verify to find.
TEST_P(IndexDamage, ForeignPartsAreNoticed) {
  const fs::path file = store_ / index_folder("", 0, kind_) / index_chunk_name({0, 0, 0});
  const std::string whole = content_of(file);
  using Ranges = std::vector<ValueRange<std::int16_t>>;
  const auto index_of = [&](IndexKind kind, Int3 grid) {
    return build_index<std::int16_t>(kind, Ranges(static_cast<std::size_t>(volume(grid)), {0, 9}),
                                     grid);
  };
  const IndexKind other = GetParam() == IndexKind::octree ? IndexKind::kdtree : IndexKind::octree;
  std::vector<std::byte> broken = part(1);
  broken[broken.size() / 2] = std::byte{0xee};
  broken[20] = std::byte{0xff};  // more stored items than there are
  for (const auto& content : std::initializer_list<std::optional<std::vector<std::byte>>>{
           index_of(other, {8, 8, 8}), index_of(GetParam(), {4, 8, 16}),
           std::vector<std::byte>(100), std::vector<std::byte>{}, std::nullopt, broken}) {
    replace_part(1, content);
    expect_noticed(file, "part");
    write(file, whole);
    replace_part(0, content);
    expect_noticed(file, "directory");
    write(file, whole);
  }
  replace_part(1, index_of(GetParam(), {8, 8, 8}));
  const VerifyReport report = verify_quietly(store_);
  ASSERT_EQ(report.damage_count, 1u);
  EXPECT_NE(report.damages[0].find(kind_ + " index, index brick (0, 0, 0)"), std::string::npos)
      << report.damages[0];
}

TEST_P(IndexDamage, OfSamplesIsNotBlamedOnTheIndex) {
  const auto place = *StoreReader(store_).locate(0, {1, 0, 0});
  std::string bytes = content_of(store_ / place.key);
  bytes[place.offset + 9] ^= 1;
  write(store_ / place.key, bytes);
  const VerifyReport report = verify_quietly(store_);
  EXPECT_EQ(report.damage_count, 1u);
  EXPECT_NE(report.damages.at(0).find("brick (1, 0, 0)"), std::string::npos) << report.damages[0];
}

TEST_P(IndexDamage, AnIndexOfAnotherLevelIsNoticed) {
  MemorySource source = make_source<std::int16_t>({149, 70, 70}, 4);
  convert_quietly(source, folder_ / "b", {.levels = 1, .index = GetParam(), .leaf = 8});
  fs::remove_all(store_ / index_folder("", 0, kind_));
  fs::copy(folder_ / "b" / index_folder("", 0, kind_), store_ / index_folder("", 0, kind_),
           fs::copy_options::recursive);
  expect_noticed(store_ / index_folder("", 0, kind_) / kIndexDescription, "another level");
}

INSTANTIATE_TEST_SUITE_P(Kinds, IndexDamage, ::testing::ValuesIn(kStoredKinds));

}  // namespace
}  // namespace isobrick::test
