#include "gpu/resident/resident_sizes.h"
#include "surface/surface_extractor.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

#include "core/morton.h"
#include "core/tile.h"

// What stays on a device, which needs no device to tell.

namespace isobrick::inline v0 {
namespace {

const Lattice kLattice{{200, 131, 260}, {64, 64, 64}, ScalarType::u16};

TEST(TilesToLoad, HoldEverySampleThatASurfaceLooksAtAndNoMore) {
  const std::vector<Int3> searched{{0, 0, 0}, {6, 1, 2}, {3, 4, 8}};
  for (const Index reach : {0, 1}) {
    std::set<std::uint64_t> needed;
    for (const Int3 tile : searched) {
      Box3 samples;
      for_each_needed_box(kLattice, {tile, 0xff}, reach, [&](Box3 box) { samples = box; });
      for_each_point(samples, [&](Int3 p) {
        needed.insert(morton_encode({p.x / kTileEdge, p.y / kTileEdge, p.z / kTileEdge}));
      });
    }
    std::vector<std::uint64_t> loaded;
    for (const Int3 tile : gpu::tiles_to_load(kLattice, searched, reach))
      loaded.push_back(morton_encode(tile));
    EXPECT_TRUE(std::is_sorted(loaded.begin(), loaded.end()));
    // A tile at the upper border has the last samples itself.
    for (const std::uint64_t code : needed)
      EXPECT_TRUE(std::binary_search(loaded.begin(), loaded.end(), code));
    EXPECT_EQ(loaded.size(), needed.size());
  }
  EXPECT_TRUE(gpu::tiles_to_load(kLattice, {}, 1).empty());
}

TEST(ResidentSizes, CountWhatStaysAndTheMeshToExpect) {
  const gpu::ResidentSizes few = gpu::resident_sizes(kLattice, {10, 30, 5}, false),
                           more = gpu::resident_sizes(kLattice, {20, 60, 10}, false),
                           normals = gpu::resident_sizes(kLattice, {10, 30, 5}, true);
  constexpr std::uint64_t block = 2 * 32 * 32 * 32;
  EXPECT_GT(few.volume_bytes, 31 * block);
  EXPECT_LT(few.volume_bytes, 31 * block * 11 / 10);
  EXPECT_GE(more.volume_bytes, few.volume_bytes + 30 * block);
  EXPECT_EQ(normals.volume_bytes, few.volume_bytes);
  // A sheet across a tile has some 1,000 vertices, and twice as many triangles.
  const std::uint64_t sheet = mesh_bytes({1000, 2000}, false);
  EXPECT_GT(more.extractor_bytes - few.extractor_bytes, 5 * sheet);
  EXPECT_LT(more.extractor_bytes - few.extractor_bytes, 15 * sheet);
  EXPECT_GE(normals.extractor_bytes - few.extractor_bytes, 5 * 1000 * sizeof(Vec3f));
}

}  // namespace
}  // namespace isobrick
