#include "io/meshes/levels/shard_files.h"

#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <iterator>

#include "tests/temporary_folder.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

TEST(MurmurHash, IsThatOfNeuroglancer) {
  // By lib/util/hash.js of neuroglancer 2.41.2.
  EXPECT_EQ(murmur_hash(0), 0x4772b084e028ae41U);
  EXPECT_EQ(murmur_hash(1), 0xe8bd67d616d4ce9aU);
  EXPECT_EQ(murmur_hash(1000), 0xfc1b462deff0cd6fU);
  EXPECT_EQ(murmur_hash(0x123456789abcdef), 0x708036264c109d93U);
  EXPECT_EQ(murmur_hash(~std::uint64_t{0}), 0x574f66bd212b5d1aU);
}

TEST(ShardBits, GrowWithTheBytesAndTheSegments) {
  const auto bits = [](std::uint64_t segments, std::uint64_t bytes) {
    const ShardBits chosen = choose_shard_bits(segments, bytes);
    return std::pair(chosen.minishard, chosen.shard);
  };
  EXPECT_EQ(bits(1, 1000), std::pair(0, 0));
  EXPECT_EQ(bits(1, std::uint64_t{5} << 30), std::pair(0, 4));
  EXPECT_EQ(bits(2000, 1000), std::pair(2, 0));
  EXPECT_EQ(bits(1'000'000, std::uint64_t{5} << 30), std::pair(7, 4));
}

std::uint64_t number_at(const std::string& bytes, std::size_t at) {
  std::uint64_t number = 0;
  std::memcpy(&number, bytes.data() + at, sizeof(number));
  return number;
}

/// The bytes before the end of a segment's entry in a shard, by the format's specification.
std::string find_in_shards(const fs::path& folder, std::uint64_t id, ShardBits bits,
                           std::uint64_t bytes_before) {
  const std::uint64_t hash = murmur_hash(id);
  const std::uint64_t minishard = hash & ((1U << bits.minishard) - 1),
                      shard = hash >> bits.minishard & ((1U << bits.shard) - 1);
  char name[32];
  std::snprintf(name, sizeof(name), "%0*llx.shard", bits.shard > 4 ? 2 : 1,
                static_cast<unsigned long long>(shard));
  std::ifstream file(folder / name, std::ios::binary);
  const std::string all{std::istreambuf_iterator<char>(file), {}};
  const std::size_t data = (std::size_t{1} << bits.minishard) * 16;
  const std::size_t begin = data + number_at(all, 16 * minishard),
                    end = data + number_at(all, 16 * minishard + 8);
  const std::size_t count = (end - begin) / 24;
  std::uint64_t at = 0, place = data;
  for (std::size_t i = 0; i < count; ++i) {
    at += number_at(all, begin + 8 * i);
    place += number_at(all, begin + 8 * (count + i));
    const std::uint64_t size = number_at(all, begin + 8 * (2 * count + i));
    if (at == id) return all.substr(place - bytes_before, bytes_before + size);
    place += size;
  }
  return "not found";
}

TEST(ShardFiles, EverySegmentIsFound) {
  for (const ShardBits bits :
       {ShardBits{0, 0}, ShardBits{2, 0}, ShardBits{1, 3}, ShardBits{3, 6}}) {
    const TemporaryFolder folder;
    FileWriter from = open_scratch_beside((folder / "scratch").string());
    std::map<std::uint64_t, ShardEntry> entries;
    const auto fragments = [](std::uint64_t id) { return std::string(id % 7, 'f'); };
    const auto manifest = [](std::uint64_t id) { return "manifest " + std::to_string(id); };
    for (std::uint64_t id = 0; id < 200; id += 3) {
      entries[id * id] = {from.size(), fragments(id).size(), manifest(id).size()};
      from.append(fragments(id) + manifest(id));
    }
    std::uint64_t sum = 0;
    const std::uint64_t bytes = write_shards(folder / "", from, entries, bits);
    for (const auto& entry : fs::directory_iterator(folder / "")) sum += entry.file_size();
    EXPECT_EQ(bytes, sum);
    for (std::uint64_t id = 0; id < 200; id += 3)
      EXPECT_EQ(find_in_shards(folder / "", id * id, bits, fragments(id).size()),
                fragments(id) + manifest(id));
    EXPECT_EQ(find_in_shards(folder / "", 5, bits, 0), "not found");
  }
}

}  // namespace
}  // namespace isobrick::test
