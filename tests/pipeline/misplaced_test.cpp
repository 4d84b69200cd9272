#include <gtest/gtest.h>

#include "bricks/stored_index.h"
#include "tests/pipeline/index_fixture.h"

// Files of a store whose checksums are right, at the place of others.

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

/// Two chunks of ranges and of the index along x, and shards of two bricks an edge.
constexpr Int3 kPlacedExtent{560, 36, 33};
constexpr double kIsovalue = 1000;

class Misplaced : public ::testing::Test {
 protected:
  void SetUp() override {
    make(store_, 1);
    make(twin_, -1);
    mesh_ = mesh(std::nullopt);
    ASSERT_NE(mesh_, "");
  }

  /// Waves on a slope, which falls in the twin.
  static void make(const fs::path& store, int sign) {
    std::vector<std::int16_t> samples;
    for_each_point({{0, 0, 0}, kPlacedExtent}, [&](Int3 p) {
      const Index x = sign > 0 ? p.x : kPlacedExtent.x - 1 - p.x;
      samples.push_back(
          static_cast<std::int16_t>(3 * x + 40 * ((p.x / 8 + p.y / 8 + p.z / 8) % 2) + p.y + p.z));
    });
    MemorySource source(kPlacedExtent, ScalarType::i16, as_bytes(samples));
    convert_quietly(source, store, {.brick = 16, .shard = 32, .levels = 1});
    for (const IndexKind kind : {IndexKind::octree, IndexKind::interval})
      add_index_quietly(store, {.kind = kind, .leaf = 8});
  }

  std::string mesh(std::optional<IndexKind> kind) {
    return mesh_of(store_, {.isovalue = kIsovalue}, kind);
  }

  /// Every way to search the store reports the damage or makes the right mesh.
  void expect_told_or_right(const std::string& what) {
    for (const std::optional<IndexKind> kind :
         {std::optional<IndexKind>(), std::optional(IndexKind::octree),
          std::optional(IndexKind::interval)}) {
      std::string made;
      try {
        made = mesh(kind);
      } catch (const Error&) {
        ++refused_;
        continue;
      }
      EXPECT_TRUE(made == mesh_) << what;
    }
    EXPECT_GE(verify_quietly(store_).damage_count, 1u) << what;
  }

  void put(const std::string& file, const std::string& bytes) {
    std::ofstream(store_ / file, std::ios::binary) << bytes;
  }

  TemporaryFolder folder_;
  fs::path store_ = folder_ / "a", twin_ = folder_ / "b";
  std::string mesh_;
  int refused_ = 0;
};

/// Files that could take each other's place: those of one folder tree.
std::string group_of(const std::string& file) {
  const auto chunk = file.find("/c/");
  return chunk == std::string::npos ? file : file.substr(0, chunk);
}

TEST_F(Misplaced, FilesOfAStoreThatChangePlaces) {
  const auto tree = tree_of(store_);
  int swaps = 0;
  for (auto a = tree.begin(); a != tree.end(); ++a)
    for (auto b = std::next(a); b != tree.end(); ++b) {
      const bool chunks = a->first.find("/c/") != std::string::npos;
      if (!chunks || group_of(a->first) != group_of(b->first) || a->second == b->second) continue;
      // Of many shards some pairs.
      if (group_of(a->first) == "0" && ++swaps % 37 != 0) continue;
      put(a->first, b->second);
      put(b->first, a->second);
      expect_told_or_right(a->first + " and " + b->first);
      put(a->first, a->second);
      put(b->first, b->second);
    }
  EXPECT_GT(refused_, 20);
  EXPECT_TRUE(mesh(IndexKind::octree) == mesh_);
}

TEST_F(Misplaced, FilesOfAnotherStore) {
  const auto tree = tree_of(store_), other = tree_of(twin_);
  int shards = 0;
  for (const auto& [file, bytes] : tree) {
    const auto found = other.find(file);
    if (found == other.end() || found->second == bytes || file.ends_with("/zarr.json") ||
        file == "zarr.json")
      continue;
    if (group_of(file) == "0" && ++shards % 5 != 0) continue;
    put(file, found->second);
    expect_told_or_right(file);
    put(file, bytes);
  }
  EXPECT_GT(refused_, 10);
}

TEST_F(Misplaced, RangesOfAnotherStoreAsAWhole) {
  for (const char* folder :
       {"isobrick/0/range", "isobrick/0/block_range", "isobrick/0/brick_crc32c",
        "isobrick/0/index/octree", "isobrick/0/index/interval"}) {
    fs::rename(store_ / folder, folder_ / "kept");
    fs::copy(twin_ / folder, store_ / folder, fs::copy_options::recursive);
    expect_told_or_right(folder);
    fs::remove_all(store_ / folder);
    fs::rename(folder_ / "kept", store_ / folder);
  }
  EXPECT_GT(refused_, 4);
}

// Bricks whose ranges are alike: only their checksums differ.

enum class Content : std::uint8_t { noise, mask };

struct Alike {
  const char* name;
  Content content;
  ConvertOptions options;
};

class MisplacedAlike : public ::testing::TestWithParam<Alike> {
 protected:
  static constexpr Int3 kCube{72, 70, 66};

  void SetUp() override {
    make(store_, 1);
    make(twin_, 2);
    mesh_ = mesh();
    ASSERT_NE(mesh_, "");
  }

  static void make(const fs::path& store, unsigned seed) {
    std::vector<std::uint8_t> samples = make_samples<std::uint8_t>(kCube, seed, false);
    if (GetParam().content == Content::mask)
      for_each_point({{0, 0, 0}, kCube}, [&](Int3 p) {
        const Int3 d = p - Int3{36, 30 + static_cast<Index>(seed), 33};
        samples[static_cast<std::size_t>(linear_index(p, kCube))] =
            d.x * d.x + d.y * d.y + d.z * d.z < 900 ? 1 : 0;
      });
    MemorySource source(kCube, ScalarType::u8, as_bytes(samples));
    convert_quietly(source, store, GetParam().options);
  }

  std::string mesh() const {
    const double isovalue = GetParam().content == Content::mask ? 0.5 : 127.5;
    return mesh_of(store_, {.isovalue = isovalue}, std::nullopt);
  }

  /// The files of bricks of level 0.
  std::vector<std::string> brick_files() const {
    std::vector<std::string> files;
    for (const auto& [file, bytes] : tree_of(store_))
      if (file.starts_with("0/") && !file.ends_with(".json") && !file.ends_with(".zarray"))
        files.push_back(file);
    return files;
  }

  /// The mesh is refused, naming a file, or right; and verify() sees the damage.
  void expect_told_or_right(const std::string& what) {
    try {
      EXPECT_TRUE(mesh() == mesh_) << what;
    } catch (const DamageError& error) {
      ++refused_;
      EXPECT_NE(std::string(error.what()).find((store_ / "0").string()), std::string::npos)
          << error.what();
    }
    EXPECT_GE(verify_quietly(store_).damage_count, 1u) << what;
  }

  void put(const std::string& file, const std::string& bytes) const {
    std::ofstream(store_ / file, std::ios::binary) << bytes;
  }

  TemporaryFolder folder_;
  fs::path store_ = folder_ / "a", twin_ = folder_ / "b";
  std::string mesh_;
  int refused_ = 0;
};

TEST_P(MisplacedAlike, FilesThatChangePlaces) {
  const std::vector<std::string> files = brick_files();
  const auto tree = tree_of(store_);
  ASSERT_GT(files.size(), 10u);
  std::size_t pair = 0;
  int swaps = 0;
  for (std::size_t a = 0; a < files.size(); ++a)
    for (std::size_t b = a + 1; b < files.size(); ++b) {
      const std::string &first = tree.at(files[a]), &second = tree.at(files[b]);
      if (++pair % (files.size() * files.size() / 40) != 0 || first == second) continue;
      put(files[a], second);
      put(files[b], first);
      expect_told_or_right(files[a] + " and " + files[b]);
      put(files[a], first);
      put(files[b], second);
      ++swaps;
    }
  EXPECT_GT(swaps, 5);
  if (GetParam().content == Content::noise) {
    EXPECT_EQ(refused_, swaps);
  }
  EXPECT_EQ(verify_quietly(store_).damage_count, 0u);
}

TEST_P(MisplacedAlike, FilesOfATwin) {
  const std::vector<std::string> files = brick_files();
  const auto tree = tree_of(store_), other = tree_of(twin_);
  for (std::size_t i = 0; i < files.size(); i += files.size() / 10) {
    const auto found = other.find(files[i]);
    if (found == other.end() || found->second == tree.at(files[i])) continue;
    put(files[i], found->second);
    expect_told_or_right(files[i]);
    put(files[i], tree.at(files[i]));
  }
  EXPECT_GT(refused_, 0);
}

TEST_P(MisplacedAlike, AWholeLevelOfATwin) {
  fs::remove_all(store_ / "0");
  fs::copy(twin_ / "0", store_ / "0", fs::copy_options::recursive);
  expect_told_or_right("level 0");
  EXPECT_EQ(refused_, 1);
}

TEST_P(MisplacedAlike, AFileThatIsGone) {
  int gone = 0;
  for (const std::string& file : brick_files()) {
    if (++gone % 7 != 0) continue;
    const std::string bytes = content_of(store_ / file);
    fs::remove(store_ / file);
    expect_told_or_right(file);
    put(file, bytes);
  }
  EXPECT_GT(refused_, 0);
}

/// What reads samples for other ends than a surface.
TEST_P(MisplacedAlike, EveryReaderSeesIt) {
  fs::remove_all(store_ / "0");
  fs::copy(twin_ / "0", store_ / "0", fs::copy_options::recursive);
  EXPECT_THROW(samples_of(StoreReader(store_), 0), DamageError);
  EXPECT_NO_THROW(samples_of(StoreReader(twin_), 0));
}

INSTANTIATE_TEST_SUITE_P(
    Stores, MisplacedAlike,
    ::testing::Values(Alike{"Noise", Content::noise, {.brick = 16, .shard = 32}},
                      Alike{"NoiseWithoutCodec",
                            Content::noise,
                            {.brick = 16, .shard = 16, .codec = BrickCodec::none}},
                      Alike{"NoiseOme04", Content::noise, {.brick = 16, .ome = OmeVersion::v04}},
                      Alike{"NoiseOme04WithoutCodec",
                            Content::noise,
                            {.brick = 16, .codec = BrickCodec::none, .ome = OmeVersion::v04}},
                      Alike{"Mask", Content::mask, {.brick = 16, .shard = 32}},
                      Alike{"MaskOme04WithoutCodec",
                            Content::mask,
                            {.brick = 16, .codec = BrickCodec::none, .ome = OmeVersion::v04}}),
    [](const ::testing::TestParamInfo<Alike>& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace isobrick::test
