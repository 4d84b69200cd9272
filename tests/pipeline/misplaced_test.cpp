#include <gtest/gtest.h>

#include "isobrick/bricks/stored_index.h"
#include "tests/pipeline/index_fixture.h"

// Files of a store whose checksums are right, at the place of others.

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

/// Two chunks of ranges and of the index along x, and shards of two bricks an edge.
constexpr Int3 kExtent{560, 36, 33};
constexpr double kIsovalue = 1000;

class Misplaced : public testing::Test {
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
    for_each_point({{0, 0, 0}, kExtent}, [&](Int3 p) {
      const Index x = sign > 0 ? p.x : kExtent.x - 1 - p.x;
      samples.push_back(
          static_cast<std::int16_t>(3 * x + 40 * ((p.x / 8 + p.y / 8 + p.z / 8) % 2) + p.y + p.z));
    });
    MemorySource source(kExtent, ScalarType::i16, as_bytes(samples));
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
  for (const char* folder : {"isobrick/0/range", "isobrick/0/block_range",
                             "isobrick/0/index/octree", "isobrick/0/index/interval"}) {
    fs::rename(store_ / folder, folder_ / "kept");
    fs::copy(twin_ / folder, store_ / folder, fs::copy_options::recursive);
    expect_told_or_right(folder);
    fs::remove_all(store_ / folder);
    fs::rename(folder_ / "kept", store_ / folder);
  }
  EXPECT_GT(refused_, 4);
}

}  // namespace
}  // namespace isobrick::test
