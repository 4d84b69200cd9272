#include <gtest/gtest.h>

#include <isobrick/verify.h>
#include "tests/pipeline/convert_store.h"

// Stores of OME-Zarr 0.4, which are Zarr version 2: each brick is a file. That others read them
// is compared in tests/third_party/volumes/check_zarr.py.
namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

const ConvertOptions kOptions{.brick = 16, .shard = 64, .ome = OmeVersion::v04, .threads = 2};

std::uint64_t damages(const fs::path& path) {
  NoProgress progress;
  return verify(path, {.threads = 2}, progress).damage_count;
}

TEST(ConvertOme04, IsTheSameStoreButForItsFiles) {
  TemporaryFolder folder;
  MemorySource source = make_source<float>({70, 45, 51}, 5, true);
  source.mutable_info().transform = {{1, 2, 2.5}, {4, 5, 6}, {0, 1, 0, 0, 0, 1, 1, 0, 0}, "meter"};
  source.mutable_info().grid_class = "fog volume";
  ConvertOptions options = kOptions;
  convert_quietly(source, folder / "v2", options);
  options.ome = OmeVersion::v05;
  convert_quietly(source, folder / "v3", options);
  const StoreReader a(folder / "v2"), b(folder / "v3");
  expect_same_levels(a, b);
  for (const LevelInfo& level : a.info().levels) EXPECT_EQ(level.shard, level.lattice.brick);
  EXPECT_TRUE(a.info().ours);
  EXPECT_TRUE(a.info().may_have_nan);
  EXPECT_EQ(a.info().grid_class, "fog volume");
  EXPECT_EQ(a.info().codec, b.info().codec);
  EXPECT_EQ(damages(folder / "v2"), 0u);
  EXPECT_TRUE(fs::exists(folder / "v2/0/1/2/3"));
  EXPECT_FALSE(fs::exists(folder / "v2/zarr.json"));
  EXPECT_FALSE(fs::exists(folder / "v2/0/zarr.json"));
  // --force knows it for a store.
  options.force = true;
  convert_quietly(source, folder / "v2", options);
  EXPECT_TRUE(fs::exists(folder / "v2/zarr.json"));
}

TEST(ConvertOme04, AResumeWritesTheSameBytes) {
  TemporaryFolder folder;
  MemorySource source = make_source<std::uint16_t>({70, 50, 83}, 3);
  convert_quietly(source, folder / "whole", kOptions);
  const auto whole = tree_of(folder / "whole");
  ConvertOptions resume = kOptions;
  resume.resume = true;
  const std::uint64_t total = source.samples().size();
  std::uint64_t kept = 0;
  for (std::uint64_t part = 1; part < 6; ++part) {
    MemorySource broken(source);
    broken.fail_after(total * part / 6);
    EXPECT_THROW(convert_quietly(broken, folder / "a", kOptions), Error);
    EXPECT_THROW(StoreReader(folder / "a.partial"), Error);
    kept = std::max(kept, convert_quietly(source, folder / "a", resume).bricks_kept);
    EXPECT_EQ(tree_of(folder / "a"), whole) << part;
    fs::remove_all(folder / "a");
  }
  EXPECT_GT(kept, 30u);
}

TEST(ConvertOme04, DamageIsFound) {
  TemporaryFolder folder;
  std::vector<std::uint16_t> samples(40 * 40 * 40);
  for (std::size_t i = 0; i < samples.size(); ++i)
    samples[i] = static_cast<std::uint16_t>(10 + i % 99);
  MemorySource source({40, 40, 40}, ScalarType::u16, as_bytes(samples));
  for (const BrickCodec codec : {BrickCodec::zstd, BrickCodec::none}) {
    ConvertOptions options = kOptions;
    options.codec = codec;
    options.force = true;
    convert_quietly(source, folder / "a", options);
    const auto changed = [&](const char* file, const auto& change) {
      const std::string bytes = content_of(folder / "a" / file);
      std::string other = bytes;
      change(other);
      EXPECT_NE(other, bytes);
      std::ofstream(folder / "a" / file, std::ios::binary) << other;
      const std::uint64_t found = damages(folder / "a");
      std::ofstream(folder / "a" / file, std::ios::binary) << bytes;
      return found;
    };
    const auto flip = [](std::string& bytes) { bytes[bytes.size() / 2] ^= 64; };
    // Plain samples have no checksum: only what leaves a range is noticed.
    EXPECT_TRUE(codec == BrickCodec::none || changed("0/0/0/0", flip) > 0);
    EXPECT_GT(
        changed(".zattrs", [](std::string& text) { text.replace(text.find("1.0"), 3, "1.5"); }),
        0u);
    EXPECT_GT(
        changed("0/.zarray", [](std::string& text) { text.replace(text.find("40"), 2, "39"); }),
        0u);
    EXPECT_EQ(damages(folder / "a"), 0u);
    // A lost file is not empty space where ranges know better.
    fs::remove(folder / "a/0/0/0/0");
    EXPECT_GT(damages(folder / "a"), 0u);
    std::vector<std::byte> brick(16 * 16 * 16 * 2);
    EXPECT_THROW(StoreReader(folder / "a").read_brick(0, {0, 0, 0}, brick.data()), DamageError);
  }
}

}  // namespace
}  // namespace isobrick::test
