#include "bricks/ranges/index_chunk.h"

#include <gtest/gtest.h>

#include "bricks/ranges/checksummed_json.h"
#include "bricks/ranges/index_layout.h"
#include "bricks/ranges/stored_ranges.h"
#include "bricks/storage/folder_storage.h"
#include "tests/bricks/store_fixture.h"
#include "tests/io/bytes/temp_dir.h"

namespace isobrick::test {
namespace {

std::vector<std::byte> part_of(std::size_t bytes, unsigned seed) {
  std::vector<std::byte> part(bytes);
  for (std::size_t i = 0; i < bytes; ++i) part[i] = static_cast<std::byte>(i * i / 7 + seed);
  return part;
}

constexpr IndexChunkName kName{{2, 1, 0}, 0x12345678};

class IndexChunkFile : public testing::TestWithParam<std::optional<int>> {
 protected:
  /// Parts 0, 2 and 4 of 5; the last one as large as `bytes`.
  void write(std::size_t bytes) {
    parts = {part_of(100, 1), {}, part_of(9, 2), {}, part_of(bytes, 3)};
    Publisher publisher(folder / "");
    IndexChunkWriter writer(publisher, path, parts.size(), kName);
    for (const std::size_t i : {std::size_t{4}, std::size_t{0}, std::size_t{2}})
      writer.append(i, encode_index_part(GetParam(), parts[i]));
    writer.publish();
    publisher.wait();
  }
  IndexChunk open(const IndexChunkName& name = kName) const {
    return {open_file_object(path), parts.size(), GetParam().has_value(), name};
  }

  void expect_refused(std::size_t at) const {
    EXPECT_THROW(
        {
          const IndexChunk chunk = open();
          std::vector<std::byte> bytes;
          for (std::size_t i = 0; i < parts.size(); ++i) chunk.read(i, bytes);
        },
        DamageError)
        << at;
  }

  TemporaryFolder folder;
  std::filesystem::path path = folder / "c/0/1/2";
  std::vector<std::vector<std::byte>> parts;
};

TEST_P(IndexChunkFile, PartsComeBack) {
  for (const std::size_t bytes : {std::size_t{1}, std::size_t{5000}, std::size_t{3} << 20}) {
    write(bytes);
    EXPECT_TRUE(IndexChunk::is_whole(path, parts.size(), kName));
    EXPECT_FALSE(IndexChunk::is_whole(path, parts.size() + 1, kName));
    for (const bool whole : {false, true}) {
      IndexChunk chunk = open();
      if (whole) chunk.read_whole();
      EXPECT_EQ(chunk.bytes(), std::filesystem::file_size(path));
      for (std::size_t i = 0; i < parts.size(); ++i) {
        std::vector<std::byte> read{std::byte{1}};
        EXPECT_EQ(chunk.read(i, read), !parts[i].empty());
        if (!parts[i].empty()) {
          EXPECT_EQ(read, parts[i]);
        }
      }
      EXPECT_GE(chunk.bytes_read(), chunk.bytes());
      EXPECT_LE(chunk.bytes_read(), 2 * chunk.bytes());
    }
  }
}

TEST_P(IndexChunkFile, EveryFlippedBitAndEveryCutIsNoticed) {
  write(300);
  const std::string whole = read_file(path);
  for (std::size_t at = 0; at < whole.size(); ++at) {
    std::string bytes = whole;
    bytes[at] = static_cast<char>(bytes[at] ^ (1 << at % 8));
    write_file(path, bytes);
    expect_refused(at);
    write_file(path, whole.substr(0, at));
    expect_refused(at);
    EXPECT_FALSE(IndexChunk::is_whole(path, parts.size(), kName));
  }
  write_file(path, whole + '\0');
  expect_refused(whole.size());
  std::filesystem::remove(path);
  EXPECT_FALSE(IndexChunk::is_whole(path, parts.size(), kName));
}

TEST_P(IndexChunkFile, AnotherPlaceOrIndexIsNoticed) {
  write(300);
  for (const IndexChunkName& other : {IndexChunkName{{1, 2, 0}, kName.index_crc32c},
                                      IndexChunkName{{2, 1, 1}, kName.index_crc32c},
                                      IndexChunkName{kName.chunk, kName.index_crc32c + 1}}) {
    EXPECT_THROW(open(other), DamageError);
    EXPECT_FALSE(IndexChunk::is_whole(path, parts.size(), other));
  }
}

TEST_P(IndexChunkFile, WhatIsNotPublishedLeavesNothing) {
  {
    Publisher publisher(folder / "");
    IndexChunkWriter writer(publisher, path, 3, kName);
    writer.append(1, part_of(10, 0));
  }
  EXPECT_TRUE(std::filesystem::is_empty(path.parent_path()));
}

INSTANTIATE_TEST_SUITE_P(Codecs, IndexChunkFile, testing::Values(std::nullopt, 3));

TEST(IndexChunkPart, AClaimOfManyBytesCostsNoMemory) {
  // A zstd frame header that promises 2^40 bytes, under a right checksum.
  std::vector<std::byte> part;
  for (const int byte : {0x28, 0xb5, 0x2f, 0xfd, 0xe0, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0})
    part.push_back(static_cast<std::byte>(byte));
  const std::uint32_t crc = crc32c(part);
  for (int i = 0; i < 4; ++i) part.push_back(static_cast<std::byte>(crc >> 8 * i));
  const TemporaryFolder folder;
  Publisher publisher(folder / "");
  IndexChunkWriter writer(publisher, folder / "0", 1, kName);
  writer.append(0, part);
  writer.publish();
  publisher.wait();
  const IndexChunk chunk(open_file_object(folder / "0"), 1, true, kName);
  std::vector<std::byte> bytes;
  try {
    chunk.read(0, bytes);
    FAIL();
  } catch (const DamageError& e) {
    EXPECT_NE(std::string(e.what()).find("1099511627776 bytes are too many"), std::string::npos)
        << e.what();
  }
}

TEST(IndexLayoutJson, RoundTrip) {
  for (const std::optional<int> zstd : {std::optional<int>(), std::optional(7)}) {
    const IndexLayout layout{"octree", 4, ScalarType::f32, {1000, 70, 3}, zstd, 5};
    EXPECT_EQ(parse_index_layout(to_json(layout), "here"), layout);
  }
}

TEST(IndexLayoutJson, EveryChangeIsNoticed) {
  const std::string text = to_json(IndexLayout{"octree", 4, ScalarType::f32, {1000, 70, 3}, 3});
  for (std::size_t at = 0; at < text.size(); ++at) {
    std::string changed = text;
    changed[at] = static_cast<char>(changed[at] ^ 0x11);
    // What JSON does not care about is no change.
    const bool blank = text[at] == ' ' || text[at] == '\n';
    if (blank) continue;
    EXPECT_THROW(parse_index_layout(changed, "here"), DamageError) << changed;
    EXPECT_THROW(parse_index_layout(text.substr(0, at), "here"), DamageError);
  }
}

TEST(IndexLayoutJson, UnknownVersionsAndOtherGeometryAreRefused) {
  const auto with = [](const char* key, const nlohmann::json& value) {
    auto json =
        read_checksummed_json(to_json(IndexLayout{"octree", 4, ScalarType::u8, {9, 9, 9}, {}}), "");
    json[key] = value;
    return checksum_json(json);
  };
  EXPECT_THROW(parse_index_layout(with("isobrick_index", 3), "here"), Error);
  for (const auto& [key, value] : std::vector<std::pair<const char*, nlohmann::json>>{
           {"leaf", 3}, {"brick", 32}, {"chunk", 64}, {"data_type", "u8"}, {"shape", {1, 2}}})
    EXPECT_THROW(parse_index_layout(with(key, value), "here"), DamageError) << key;
}

TEST(IndexLayout, Geometry) {
  const IndexLayout layout{"octree", 4, ScalarType::u8, {1025, 66, 64}, {}};
  EXPECT_EQ(layout.bricks(), (Int3{16, 2, 1}));
  EXPECT_EQ(layout.chunks(), (Int3{2, 1, 1}));
  EXPECT_EQ(layout.bricks_of_chunk({1, 0, 0}), (Box3{{8, 0, 0}, {16, 2, 1}}));
  EXPECT_EQ(layout.parts_of_chunk({1, 0, 0}), 17u);
  EXPECT_EQ(layout.part_of_brick({9, 1, 0}), 10u);
  EXPECT_EQ(layout.leaves_of_brick({9, 1, 0}), (Int3{16, 1, 16}));
  const IndexLayout flat{"octree", 4, ScalarType::u8, {100, 1, 64}, {}};
  EXPECT_EQ(volume(flat.chunks()), 0);
}

TEST(StoredRangesJson, RoundTripAndChanges) {
  const TemporaryFolder folder;
  EXPECT_FALSE(read_stored_ranges(*folder_storage(folder / "a"), ""));
  const StoredRanges ranges{
      .may_have_nan = false, .image_crc32c = 0xfedcba98, .levels = {{1, 2, 3}, {3, 0xfedcba97, 4}}};
  const std::string text = to_json(ranges);
  write_file(folder / "a" / ranges_file(""), text);
  EXPECT_EQ(read_stored_ranges(*folder_storage(folder / "a"), ""), ranges);
  for (std::size_t at = 0; at < text.size(); ++at) {
    if (text[at] == ' ' || text[at] == '\n') continue;
    std::string changed = text;
    changed[at] = static_cast<char>(changed[at] ^ 0x11);
    write_file(folder / "a" / ranges_file(""), changed);
    EXPECT_THROW(read_stored_ranges(*folder_storage(folder / "a"), ""), DamageError) << changed;
  }
}

TEST(StoredRangesJson, ANewerVersionWantsANewerProgram) {
  const TemporaryFolder folder;
  const std::string text = to_json(StoredRanges{});
  const auto message_for = [&](int version) {
    nlohmann::json json = read_checksummed_json(text, "");
    json["isobrick_ranges"] = version;
    write_file(folder / "a" / ranges_file(""), checksum_json(json));
    return message_of<Error>([&] { read_stored_ranges(*folder_storage(folder / "a"), ""); });
  };
  EXPECT_TRUE(message_for(1).ends_with("remove the file and run isobrick index")) << message_for(1);
  EXPECT_TRUE(message_for(9).ends_with("use a newer version of isobrick")) << message_for(9);
}

}  // namespace
}  // namespace isobrick::test
