#include "viewer/scene/node_mesher.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>

#include "tests/stream/always.h"
#include "tests/stream/memory_bricks.h"
#include "tests/surface/field.h"
#include "tests/viewer/scene/random_cut.h"

namespace isobrick::test {
namespace {

using Field = std::function<double(Int3, Index)>;

std::shared_ptr<MemoryBricks> cube_of(const Field& field, Index n,
                                      const MemoryBricks::Options& options = {}) {
  return std::make_shared<MemoryBricks>(
      Int3{n, n, n},
      std::function<float(Int3)>([&](Int3 p) { return static_cast<float>(field(p, n)); }), options);
}

/// The meshes of all nodes of a cut.
std::vector<NodeMesh> meshes_of(std::shared_ptr<const BrickSource> source, const Cut& cut,
                                Vec3d origin = {}) {
  const NodeGrid grid(source->info());
  ResidentBricks bricks(std::move(source), std::uint64_t{1} << 30);
  NodeMesher mesher(grid, bricks, origin);
  std::vector<NodeMesh> meshes;
  for (const CutNode& node : cut.nodes)
    meshes.push_back(mesher.mesh(node.key, cut.isovalues.front(), node.coarser, Always()));
  return meshes;
}

Cut uniform_cut(const NodeGrid& grid, int level, double isovalue) {
  Cut cut;
  cut.isovalues = {isovalue};
  for_each_point({{0, 0, 0}, grid.level(level).nodes}, [&](Int3 p) {
    cut.nodes.push_back({{level, p}});
  });
  return cut;
}

/// Joins meshes: vertices at the same position, bit by bit, become one.
testing::Mesh weld(const std::vector<NodeMesh>& meshes) {
  testing::Mesh whole;
  std::map<std::array<float, 3>, std::uint32_t> numbers;
  for (const NodeMesh& node : meshes) {
    std::vector<std::uint32_t> number;
    for (std::size_t i = 0; i < node.mesh.positions.size(); ++i) {
      const Vec3f p = node.mesh.positions[i];
      const auto next = static_cast<std::uint32_t>(whole.positions.size());
      const auto [place, added] = numbers.try_emplace({p.x, p.y, p.z}, next);
      if (added) {
        whole.positions.push_back(p);
        whole.normals.push_back(node.mesh.normals[i]);
      }
      EXPECT_EQ(whole.normals[place->second], node.mesh.normals[i]);
      number.push_back(place->second);
    }
    for (const Triangle& t : node.mesh.triangles)
      whole.triangles.push_back({number[t[0]], number[t[1]], number[t[2]]});
  }
  return whole;
}

/// Each edge occurs as often in one direction as in the other.
bool closed(const testing::Mesh& mesh) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> forward, backward;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) {
      forward.emplace_back(t[i], t[(i + 1) % 3]);
      backward.emplace_back(t[(i + 1) % 3], t[i]);
    }
  std::sort(forward.begin(), forward.end());
  std::sort(backward.begin(), backward.end());
  return !forward.empty() && forward == backward;
}

TEST(NodeMesher, NodesOfTheFinestLevelMakeTheSurfaceOfTheExtractor) {
  const Index n = 140;
  const auto source = cube_of(blobs, n, {.brick = 48});
  const NodeGrid grid(source->info());
  const testing::Mesh whole = weld(meshes_of(source, uniform_cut(grid, 0, 0.25)));
  const testing::Field<float> field(
      {n, n, n}, [&](Int3 p) { return static_cast<double>(static_cast<float>(blobs(p, n))); });
  const testing::Mesh expected = testing::extract(field, {.isovalue = 0.25, .normals = true});
  EXPECT_EQ(whole.triangles.size(), expected.triangles.size());
  EXPECT_EQ(whole.positions.size(), expected.positions.size());
  EXPECT_GT(testing::closed_sides(whole), 0);
  const auto key = [](Vec3f p) {
    return std::array{std::lround(p.x * 512), std::lround(p.y * 512), std::lround(p.z * 512)};
  };
  std::map<std::array<long, 3>, Vec3f> normals;
  for (std::size_t i = 0; i < expected.positions.size(); ++i)
    normals[key(expected.positions[i])] = expected.normals[i];
  std::size_t same = 0;
  for (std::size_t i = 0; i < whole.positions.size(); ++i)
    if (const auto found = normals.find(key(whole.positions[i])); found != normals.end()) {
      ++same;
      for (int axis = 0; axis < 3; ++axis)
        EXPECT_NEAR(whole.normals[i][axis], found->second[axis], 2e-3);
    }
  EXPECT_GT(same, whole.positions.size() * 9 / 10);
}

TEST(NodeMesher, EveryLevelAloneIsClosedAndSharesVerticesBitByBit) {
  int number = 0;
  for (const Field& field : {Field(ball), Field(gyroid_ball), Field(blobs)}) {
    ++number;
    const auto source = cube_of(field, 171);
    const NodeGrid grid(source->info());
    for (int v = 0; v < grid.levels(); ++v)
      EXPECT_TRUE(closed(weld(meshes_of(source, uniform_cut(grid, v, 0.013), {85, 85, 85}))))
          << "level " << v << " of field " << number;
  }
}

TEST(NodeMesher, WorldSpaceFollowsSpacingDirectionAndOrigin) {
  MemoryBricks::Options options;
  options.transform.spacing = {0.5, 1, 2};
  options.transform.origin = {1e6, -2e6, 3e6};
  options.transform.direction = {0, -1, 0, 1, 0, 0, 0, 0, -1};  // mirrored
  const Index n = 70;
  const auto source = cube_of(ball, n, options);
  const NodeGrid grid(source->info());
  const Vec3d middle = options.transform.apply({34.5, 34.5, 34.5});
  const auto meshes = meshes_of(source, uniform_cut(grid, 0, 0), middle);
  double six_volumes = 0;
  for (const NodeMesh& mesh : meshes) {
    for (std::size_t i = 0; i < mesh.mesh.positions.size(); ++i) {
      const Vec3f p = mesh.mesh.positions[i], normal = mesh.mesh.normals[i];
      const double x = p.x / 1.0, y = p.y / 0.5, z = p.z / 2.0;
      EXPECT_NEAR(std::sqrt(x * x + y * y + z * z), 0.4 * n, 0.02);
      EXPECT_GT(normal.x * p.x + normal.y * p.y + normal.z * p.z, 0);
    }
    for (const Triangle& t : mesh.mesh.triangles) {
      const Vec3f a = mesh.mesh.positions[t[0]], b = mesh.mesh.positions[t[1]],
                  c = mesh.mesh.positions[t[2]];
      six_volumes += a.x * (b.y * c.z - b.z * c.y) - a.y * (b.x * c.z - b.z * c.x) +
                     a.z * (b.x * c.y - b.y * c.x);
    }
  }
  EXPECT_NEAR(six_volumes / 6, 4.18879 * 28 * 28 * 28, 300) << "counter-clockwise from outside";
}

TEST(NodeMesher, HolesOfNaNAndAbsentBricksDoNotDisturbIt) {
  const Index n = 100;
  const auto field = [&](Int3 p) -> float {
    if (p.x > 60 && p.y > 60) return std::numeric_limits<float>::quiet_NaN();
    if (p.x < 32 && p.y < 32 && p.z < 32) return -1.0f;
    return static_cast<float>(blobs(p, n));
  };
  const auto source = std::make_shared<MemoryBricks>(
      Int3{n, n, n}, std::function<float(Int3)>(field), MemoryBricks::Options{.fill_value = -1});
  const NodeGrid grid(source->info());
  for (unsigned seed = 1; seed < 4; ++seed) {
    const Cut cut = RandomCut(grid, seed, 3).cut({0});
    std::size_t triangles = 0;
    for (const NodeMesh& mesh : meshes_of(source, cut)) {
      for (const Vec3f p : mesh.mesh.positions) {
        EXPECT_TRUE(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z));
      }
      for (const Vec3f v : mesh.mesh.normals)
        EXPECT_NEAR(v.x * v.x + v.y * v.y + v.z * v.z, 1, 1e-4);
      triangles += mesh.mesh.triangles.size();
    }
    EXPECT_GT(triangles, 1000u);
  }
}

/// The mesh that a device makes of stored samples, made here.
template <class T>
void expect_the_mesh_of_stored_samples() {
  const Index n = 150;
  MemoryBricks::Options options;
  options.fill_value = 30;
  const auto source = std::make_shared<MemoryBricks>(
      Int3{n, n, n},
      std::function<T(Int3)>([](Int3 p) { return static_cast<T>(30 + std::max(0.0, ball(p, n))); }),
      options);
  const NodeGrid grid(source->info());
  ResidentBricks bricks(source, std::uint64_t{1} << 30);
  NodeMesher mesher(grid, bricks, {1, 2, 3});
  std::uint64_t triangles = 0;
  for (const CutNode& node : uniform_cut(grid, 0, 0).nodes) {
    GridView view = mesher.grid(node.key, 40, 0, Always(), NodeMesher::Form::stored_if_possible);
    ASSERT_EQ(view.stored.type, scalar_type_of<T>);
    std::vector<float> values;
    const T* samples = static_cast<const T*>(view.stored.samples);
    for (int i = 0; i < view.around_n[0] * view.around_n[1] * view.around_n[2]; ++i)
      values.push_back(point_value(samples[i], view.stored.isovalue));
    view.around = values.data();
    view.values =
        view.around + view.shift[2] * view.plane + view.shift[1] * view.row + view.shift[0];
    const NodeMesh a = mesher.extract(view, {}), b = mesher.mesh(node.key, 40, 0, Always());
    EXPECT_TRUE(std::ranges::equal(a.mesh.positions, b.mesh.positions));
    EXPECT_TRUE(std::ranges::equal(a.mesh.normals, b.mesh.normals));
    EXPECT_TRUE(std::ranges::equal(a.mesh.triangles, b.mesh.triangles));
    triangles += a.triangles();
  }
  EXPECT_GT(triangles, 10'000u);
  EXPECT_LT(bricks.counters().reads, 125u) << "some are not needed";
}

TEST(NodeMesher, StoredSamplesAreThoseOfTheMesh) {
  expect_the_mesh_of_stored_samples<std::uint8_t>();
  expect_the_mesh_of_stored_samples<std::int8_t>();
  expect_the_mesh_of_stored_samples<std::uint16_t>();
  expect_the_mesh_of_stored_samples<std::int16_t>();
}

TEST(NodeMesher, ValuesAreGivenWhereStoredSamplesWouldNotDo) {
  const auto source = cube_of(ball, 150);
  const NodeGrid grid(source->info());
  ResidentBricks bricks(source, std::uint64_t{1} << 30);
  NodeMesher mesher(grid, bricks, {});
  const auto form = NodeMesher::Form::stored_if_possible;
  EXPECT_EQ(mesher.grid({0, {0, 0, 0}}, 0, 0, Always(), form).stored.samples, nullptr) << "floats";
  const auto bytes = std::make_shared<MemoryBricks>(
      Int3{150, 150, 150},
      std::function<std::uint8_t(Int3)>([](Int3 p) { return static_cast<std::uint8_t>(p.x); }),
      MemoryBricks::Options{});
  ResidentBricks others(bytes, std::uint64_t{1} << 30);
  NodeMesher other(grid, others, {});
  const auto stored = [&](NodeKey key, std::uint32_t coarser) {
    return other.grid(key, 40.5, coarser, Always(), form).stored.samples != nullptr;
  };
  EXPECT_TRUE(stored({0, {0, 0, 0}}, 0));
  EXPECT_FALSE(stored({1, {0, 0, 0}}, 0)) << "points between samples";
  EXPECT_FALSE(stored({0, {1, 0, 0}}, 1u << 26 >> 1)) << "a neighbour's values";
}

TEST(NodeMesher, SaysNothingAndThrowsWhenItIsAbandoned) {
  class AlwaysCancelled final : public CancellationToken {
   public:
    void check() const override { throw OperationCancelled(); }
  };
  const auto source = cube_of(ball, 70);
  const NodeGrid grid(source->info());
  ResidentBricks bricks(source, 1 << 20);
  NodeMesher mesher(grid, bricks, {});
  EXPECT_THROW(mesher.mesh({0, {0, 0, 0}}, 0, 0, AlwaysCancelled()), OperationCancelled);
}

template <class T>
bool same_bytes(const PodBuffer<T>& a, const PodBuffer<T>& b) {
  return a.size() == b.size() &&
         std::equal(a.begin(), a.end(), b.begin(),
                    [](const T& p, const T& q) { return std::memcmp(&p, &q, sizeof(T)) == 0; });
}

/// Number of bricks of the finest level that a mesher without resident bricks reads for that
/// level's nodes. Its meshes must equal those made with all bricks resident, and it must read each
/// announced brick.
std::uint64_t reads_of_same_meshes(const std::shared_ptr<MemoryBricks>& source, const Cut& cut) {
  const NodeGrid grid(source->info());
  ResidentBricks all(source, std::uint64_t{1} << 30), some(source, std::uint64_t{1} << 30);
  for_each_point({{0, 0, 0}, source->info().levels[0].lattice.bricks()},
                 [&](Int3 b) { (void)all.get(0, b, Always()); });
  NodeMesher whole(grid, all, {}), sparing(grid, some, {});
  (void)source->take_hints();
  std::uint64_t triangles = 0;
  const double isovalue = cut.isovalues.front();
  for (const CutNode& node : cut.nodes) {
    if (node.key.level > 0) continue;
    sparing.will_need(node.key, isovalue, node.coarser);
    const NodeMesh a = whole.mesh(node.key, isovalue, node.coarser, Always()),
                   b = sparing.mesh(node.key, isovalue, node.coarser, Always());
    EXPECT_TRUE(same_bytes(a.mesh.positions, b.mesh.positions) &&
                same_bytes(a.mesh.normals, b.mesh.normals) &&
                same_bytes(a.mesh.triangles, b.mesh.triangles));
    triangles += a.triangles();
  }
  EXPECT_GT(triangles, 1'000u);
  const auto hints = source->take_hints();
  EXPECT_FALSE(hints.empty());
  for (const auto& [level, x, y, z] : hints) {
    EXPECT_NE(some.find(level, {x, y, z}), nullptr) << x << ' ' << y << ' ' << z;
  }
  return some.counters().reads;
}

TEST(NodeMesher, BricksThatNoBlockNeedsAreNotReadAndNeverShow) {
  const Index n = 150;
  for (const auto& field : {ball, gyroid_ball, blobs})
    for (const Index brick : {16, 32}) {
      const auto source = std::make_shared<MemoryBricks>(
          Int3{n, n, n}, std::function<std::int16_t(Int3)>([&](Int3 p) {
            return static_cast<std::int16_t>(std::lround(20 * field(p, n)));
          }),
          MemoryBricks::Options{.brick = brick});
      const NodeGrid grid(source->info());
      const std::uint64_t reads = reads_of_same_meshes(source, uniform_cut(grid, 0, 7.5));
      if (field == ball && brick == 16) {
        EXPECT_LT(reads,
                  static_cast<std::uint64_t>(volume(source->info().levels[0].lattice.bricks())));
      }
      (void)reads_of_same_meshes(source, RandomCut(grid, 3, 5).cut({7.5}));
    }
}

TEST(NodeMesher, BesideWhatIsNoNumberTwoSidesMeetWithoutASurface) {
  const Index n = 150;
  const auto field = [&](Int3 p) {
    if (p.y > 70) return static_cast<float>(blobs(p, n));
    // A plane at the first samples of blocks: each adjacent block lies on one side.
    if (p.x == 48) return std::numeric_limits<float>::quiet_NaN();
    return p.x < 48 ? 5.0f : -5.0f;
  };
  for (const Index brick : {16, 32}) {
    const auto source = std::make_shared<MemoryBricks>(
        Int3{n, n, n}, std::function<float(Int3)>(field), MemoryBricks::Options{.brick = brick});
    const NodeGrid grid(source->info());
    (void)reads_of_same_meshes(source, uniform_cut(grid, 0, 0.5));
    (void)reads_of_same_meshes(source, RandomCut(grid, 3, 5).cut({0.5}));
  }
}

TEST(NodeMesher, TurnsSurfacesRoundWhereSmallerSamplesAreInside) {
  constexpr Index n = 40;
  const auto source = cube_of(ball, n);
  const NodeGrid grid(source->info());
  ResidentBricks bricks(source, std::uint64_t{1} << 30);
  NodeMesher above(grid, bricks, {}), below(grid, bricks, {}, Inside::below);
  const NodeMesh a = above.mesh({0, {0, 0, 0}}, 5, 0, Always()),
                 b = below.mesh({0, {0, 0, 0}}, 5, 0, Always());
  ASSERT_GT(a.mesh.triangles.size(), 100u);
  ASSERT_EQ(a.mesh.triangles.size(), b.mesh.triangles.size());
  for (std::size_t i = 0; i < a.mesh.normals.size(); ++i)
    for (int axis = 0; axis < 3; ++axis)
      ASSERT_EQ(a.mesh.normals[i][axis], -b.mesh.normals[i][axis]);
  for (std::size_t i = 0; i < a.mesh.triangles.size(); ++i)
    ASSERT_NE(a.mesh.triangles[i], b.mesh.triangles[i]);
}

}  // namespace
}  // namespace isobrick::test
