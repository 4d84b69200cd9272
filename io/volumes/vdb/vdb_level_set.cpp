#include "io/volumes/vdb/vdb_level_set.h"

#include <openvdb/openvdb.h>
#include <openvdb/tools/Prune.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "io/volumes/vdb/triangle_distance.h"
#include "io/volumes/vdb/vdb_grid.h"
#include "io/volumes/vdb/vdb_tree.h"

namespace isobrick::inline v0 {
namespace {

/// So many pairs of a leaf and a triangle that comes near it are listed at a time: of wide
/// bands there are thousands for each triangle.
constexpr std::size_t kListed = std::size_t{1} << 20;

/// Bounds are compared with so much to spare that what is left out has no influence:
/// the result must not depend on what came first.
constexpr float kSpare = 1.00001F;

/// A voxel that is inside is negative, although it may lie on the surface.
float inside_value(float distance) {
  return -std::max(distance, std::numeric_limits<float>::min());
}

/// A triangle within the band of a leaf, and the index of that leaf.
struct LeafTriangle {
  Index leaf = 0;
  std::uint32_t triangle = 0;
};

class LevelSet final : public VdbLevelSet {
  using Tree = openvdb::FloatTree;
  using Leaf = Tree::LeafNodeType;

 public:
  LevelSet(const VolumeInfo& info, const std::string& name, int half_band, int threads,
           std::uint64_t budget)
      : extent_(info.extent),
        leaves_extent_(ceil_div(info.extent, kVdbLeafExtent)),
        unit_(std::max(
            {info.transform.spacing.x, info.transform.spacing.y, info.transform.spacing.z})),
        spacing_(info.transform.spacing * (1 / unit_)),
        band_(static_cast<float>(half_band * unit_)),
        reach_(half_band * static_cast<double>(kSpare)),
        grid_(openvdb::FloatGrid::create(band_)),
        counted_(grid_->tree(), budget),
        arena_(threads > 0 ? threads : tbb::info::default_concurrency()) {
    describe_vdb_grid(*grid_, info, name);
    grid_->setGridClass(openvdb::GRID_LEVEL_SET);
  }

  void add(std::span<const Vec3f> positions,
           std::span<const std::array<std::uint32_t, 3>> triangles) override {
    points_.clear();
    for (const Vec3f p : positions) {
      const openvdb::Vec3d index = grid_->transform().worldToIndex(openvdb::Vec3d(p.x, p.y, p.z));
      points_.push_back(Vec3d{index.x(), index.y(), index.z()} * spacing_);
    }
    leaf_triangles_.clear();
    for (std::size_t i = 0; i < triangles.size(); ++i) {
      find_leaves(triangles, i);
      if (leaf_triangles_.size() >= kListed || i + 1 == triangles.size()) measure_listed(triangles);
    }
  }

  void put_inside(Box3 box, const std::uint8_t* inside) override {
    for_each_vdb_leaf(box, [&](Int3 corner) {
      put_leaf(box, corner,
               [&](Int3 p) { return inside[linear_index(p - box.lo, box.extent())] != 0; });
    });
  }
  void put_all_inside(Box3 box) override {
    for_each_vdb_leaf(box, [&](Int3 corner) { put_leaf(box, corner, [](Int3) { return true; }); });
  }

  void write(OutputFile& file) override {
    openvdb::tools::pruneLevelSet(grid_->tree());
    write_vdb_grid(file, grid_);
  }

 private:
  struct LeafRun {
    Int3 position;
    Leaf* leaf;
    std::size_t first;  ///< of its triangles in leaf_triangles_
  };

  /// Makes the leaves that are listed, takes their voxels' distances and clears the list.
  void measure_listed(std::span<const std::array<std::uint32_t, 3>> triangles) {
    counted_.hold(points_.capacity() * sizeof(Vec3d) +
                  leaf_triangles_.capacity() * sizeof(LeafTriangle) +
                  leaves_.capacity() * sizeof(LeafRun));
    std::sort(leaf_triangles_.begin(), leaf_triangles_.end(),
              [](const LeafTriangle& a, const LeafTriangle& b) { return a.leaf < b.leaf; });
    leaves_.clear();
    for (std::size_t i = 0; i < leaf_triangles_.size(); ++i)
      if (i == 0 || leaf_triangles_[i].leaf != leaf_triangles_[i - 1].leaf) {
        const Index x = leaf_triangles_[i].leaf % leaves_extent_.x,
                    rest = leaf_triangles_[i].leaf / leaves_extent_.x;
        const Int3 leaf{x, rest % leaves_extent_.y, rest / leaves_extent_.y};
        leaves_.push_back({leaf, counted_.touch_leaf(vdb_coordinate(leaf * kVdbLeafExtent)), i});
      }
    arena_.execute([&] {
      tbb::parallel_for(std::size_t{0}, leaves_.size(), [&](std::size_t i) {
        const std::size_t end =
            i + 1 < leaves_.size() ? leaves_[i + 1].first : leaf_triangles_.size();
        for (std::size_t k = leaves_[i].first; k < end; ++k)
          measure(*leaves_[i].leaf, leaves_[i].position, triangles[leaf_triangles_[k].triangle]);
      });
    });
    leaf_triangles_.clear();
  }

  /// The voxels along an axis that a triangle between lo and hi comes near.
  std::pair<Index, Index> voxels(double lo, double hi, int axis) const {
    return {std::max<Index>(0, static_cast<Index>(std::floor((lo - reach_) / spacing_[axis]))),
            std::min<Index>(extent_[axis] - 1,
                            static_cast<Index>(std::ceil((hi + reach_) / spacing_[axis])))};
  }

  void find_leaves(std::span<const std::array<std::uint32_t, 3>> triangles, std::size_t i) {
    const Vec3d a = points_[triangles[i][0]], b = points_[triangles[i][1]],
                c = points_[triangles[i][2]];
    Box3 leaves;
    for (int axis = 0; axis < 3; ++axis) {
      const auto [first, last] = voxels(std::min({a[axis], b[axis], c[axis]}),
                                        std::max({a[axis], b[axis], c[axis]}), axis);
      if (first > last) return;
      leaves.lo[axis] = first / kVdbLeaf;
      leaves.hi[axis] = last / kVdbLeaf + 1;
    }
    const Vec3d middle = (a + b + c) * (1.0 / 3);
    const double reach =
        reach_ +
        std::sqrt(std::max({distance2(a, middle), distance2(b, middle), distance2(c, middle)}));
    for_each_point(leaves, [&](Int3 leaf) {
      Vec3d nearest;
      for (int axis = 0; axis < 3; ++axis) {
        const double lo = static_cast<double>(leaf[axis] * kVdbLeaf) * spacing_[axis];
        nearest[axis] = std::clamp(middle[axis], lo, lo + (kVdbLeaf - 1) * spacing_[axis]);
      }
      if (distance2(nearest, middle) <= reach * reach)
        leaf_triangles_.push_back(
            {linear_index(leaf, leaves_extent_), static_cast<std::uint32_t>(i)});
    });
  }

  static double distance2(Vec3d a, Vec3d b) {
    const Vec3d d = a - b;
    return d.x * d.x + d.y * d.y + d.z * d.z;
  }

  /// Takes the distances of a leaf's voxels from a triangle where they are smaller.
  void measure(Leaf& leaf, Int3 position, const std::array<std::uint32_t, 3>& triangle) const {
    // Near the leaf's corner floats are exact enough.
    const Vec3d corner = Vec3d{static_cast<double>(position.x), static_cast<double>(position.y),
                               static_cast<double>(position.z)} *
                         spacing_ * static_cast<double>(kVdbLeaf);
    Vec3f corners[3];
    for (int k = 0; k < 3; ++k) {
      const Vec3d p = points_[triangle[static_cast<std::size_t>(k)]] - corner;
      corners[k] = {static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)};
    }
    const auto [a, b, c] = corners;
    const Vec3f middle = (a + b + c) * (1.0F / 3);
    float radius2 = 0;
    for (const Vec3f p : corners) radius2 = std::max(radius2, square(p - middle));
    const float radius = std::sqrt(radius2);
    int first[3], last[3];
    for (int axis = 0; axis < 3; ++axis) {
      const auto [lo, hi] =
          voxels(corner[axis] + static_cast<double>(std::min({a[axis], b[axis], c[axis]})),
                 corner[axis] + static_cast<double>(std::max({a[axis], b[axis], c[axis]})), axis);
      first[axis] = static_cast<int>(std::max(lo - position[axis] * kVdbLeaf, Index{0}));
      last[axis] = static_cast<int>(std::min(hi - position[axis] * kVdbLeaf, kVdbLeaf - 1));
    }
    const TriangleDistance triangle_distance(a, b, c);
    const auto unit = static_cast<float>(unit_), units = static_cast<float>(1 / unit_);
    float* values = leaf.buffer().data();
    for (int x = first[0]; x <= last[0]; ++x)
      for (int y = first[1]; y <= last[1]; ++y)
        for (int z = first[2]; z <= last[2]; ++z) {
          const auto at = static_cast<openvdb::Index>(x << 6 | y << 3 | z);
          const Vec3f p{static_cast<float>(x * spacing_.x), static_cast<float>(y * spacing_.y),
                        static_cast<float>(z * spacing_.z)};
          const float reach = (values[at] * units + radius) * kSpare;
          if (square(p - middle) >= reach * reach) continue;
          const float distance = std::sqrt(triangle_distance.squared(p)) * unit;
          if (!(distance < values[at])) continue;
          values[at] = distance;
          leaf.setValueOn(at);
        }
  }

  static float square(Vec3f v) { return v.x * v.x + (v.y * v.y + v.z * v.z); }

  /// Signs of what `box` has of the 8³ voxels from `corner` on.
  template <class Inside>
  void put_leaf(Box3 box, Int3 corner, Inside&& is_inside) {
    const Box3 part = intersect({corner, corner + kVdbLeafExtent}, box);
    const openvdb::Coord at = vdb_coordinate(corner);
    Leaf* leaf = counted_.probe_leaf(at);
    if (leaf == nullptr) {
      bool all = true, any = false;
      for_each_point(part, [&](Int3 p) {
        const bool in = is_inside(p);
        all = all && in;
        any = any || in;
      });
      if (!any) return;
      if (all && part.extent() == kVdbLeafExtent) return counted_.add_tile(at, -band_, false);
      leaf = counted_.touch_leaf(at);
    }
    float* values = leaf->buffer().data();
    for_each_point(part, [&](Int3 p) {
      const Int3 q = p - corner;
      if (!is_inside(p)) return;
      float& value = values[q.x << 6 | q.y << 3 | q.z];
      value = inside_value(value);
    });
  }

  Int3 extent_, leaves_extent_;
  double unit_;    ///< the largest spacing: what is measured with
  Vec3d spacing_;  ///< in that unit
  float band_;     ///< in world space
  double reach_;   ///< of triangles, in units
  openvdb::FloatGrid::Ptr grid_;
  CountedTree<Tree> counted_;
  tbb::task_arena arena_;
  std::vector<Vec3d> points_;  ///< in index space, times spacing_
  std::vector<LeafTriangle> leaf_triangles_;
  std::vector<LeafRun> leaves_;
};

}  // namespace

std::unique_ptr<VdbLevelSet> make_vdb_level_set(const VolumeInfo& info, const std::string& name,
                                                int half_band, int threads, std::uint64_t budget) {
  openvdb::initialize();
  return std::make_unique<LevelSet>(info, name, half_band, threads, budget);
}

}  // namespace isobrick
