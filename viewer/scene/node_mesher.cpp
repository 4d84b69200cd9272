#include "viewer/scene/node_mesher.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>
#include <vector>

#include "bricks/level_set.h"
#include "surface/grid_extractor.h"
#include "surface/world_map.h"
#include "viewer/scene/node_border.h"

namespace isobrick::inline v0 {
namespace {

using Clock = std::chrono::steady_clock;

/// Half the width of a seam strip in cells: enough for a rasteriser's rounding, too little to be
/// visible.
constexpr double kSeam = 0.02;

}  // namespace

struct NodeMesher::Impl {
  const NodeGrid& grid;
  ResidentBricks& bricks;
  NodeSamples samples;
  NodeBorder border;
  GridView view;  ///< fields that are the same for all nodes
  GridValues around,
      field;  ///< node with a layer around for gradients; node with neighbours' values
  std::vector<std::byte> stored_samples;  ///< stored samples instead of `around`
  std::vector<double> places[3];  ///< positions of the points of `around`, level-0 index space
  std::vector<float> inverse[3];
  GridExtractor extractor;
  Mesh work;
  Clock::duration busy{};

  Impl(const NodeGrid& g, ResidentBricks& b, Vec3d origin, std::optional<Inside> inside)
      : grid(g), bricks(b), samples(g, b), border(g, samples) {
    const Transform& t = g.transform();
    view.may_have_nan = b.source().info().may_have_nan;
    view.map = world_map(t, inside.value_or(inside_of(b.source().info())));
    for (int i = 0; i < 9; ++i)
      view.to_world[i] = t.direction[static_cast<std::size_t>(i)] * t.spacing[i % 3];
    for (int i = 0; i < 3; ++i) view.offset[i] = t.origin[i] - origin[i];
  }

  Box3 points_around(const NodeKey& key) const {
    const Int3 n = grid.node_cells(key), all = grid.level(key.level).cells;
    Box3 box;
    for (int axis = 0; axis < 3; ++axis) {
      const Index lo = key.node[axis] * kNodeEdge;
      box.lo[axis] = lo > 0 ? lo - 1 : lo;
      box.hi[axis] = lo + n[axis] + 1 + (lo + n[axis] < all[axis] ? 1 : 0);
    }
    return box;
  }

  Box3 points(const NodeKey& key) const {
    const Int3 lo = key.node * kNodeEdge;
    return {lo, lo + grid.node_cells(key) + Int3{1, 1, 1}};
  }

  void copy_field(Box3 box) {
    field.points = box;
    const Int3 n = box.extent();
    field.values.resize(static_cast<std::size_t>(volume(n)));
    for (Index z = 0; z < n.z; ++z)
      for (Index y = 0; y < n.y; ++y)
        std::copy_n(&around.at(box.lo + Int3{0, y, z}), n.x, &field.at(box.lo + Int3{0, y, z}));
  }

  /// Computes the positions of the points of `around`.
  void find_places(int level) {
    for (int axis = 0; axis < 3; ++axis) {
      auto& at = places[axis];
      auto& inverse_at = inverse[axis];
      at.clear();
      inverse_at.clear();
      for (Index p = around.points.lo[axis]; p < around.points.hi[axis]; ++p)
        at.push_back(static_cast<double>(grid.position(level, axis, p)));
      for (std::size_t i = 0; i < at.size(); ++i)
        inverse_at.push_back(
            static_cast<float>(1 / (at[std::min(i + 1, at.size() - 1)] - at[i > 0 ? i - 1 : 0])));
    }
  }

  /// The node as a grid, with `field` on borders to coarser neighbours; without samples yet.
  GridView view_of(const NodeKey& key, bool coarser, bool values_too = true) {
    find_places(key.level);
    GridView v = view;
    const Box3 own = points(key);
    const GridValues& values = coarser ? field : around;
    const Int3 n = values.points.extent();
    if (values_too) {
      v.values = &values.at(own.lo);
      v.around = around.values.data();
    }
    v.row = static_cast<int>(n.x);
    v.plane = static_cast<int>(n.x * n.y);
    for (int axis = 0; axis < 3; ++axis) {
      v.n[axis] = static_cast<int>(own.extent()[axis]);
      v.around_n[axis] = static_cast<int>(around.points.extent()[axis]);
      v.shift[axis] = static_cast<int>(own.lo[axis] - around.points.lo[axis]);
      v.place[axis] = places[axis].data();
      v.inverse[axis] = inverse[axis].data();
    }
    v.seam_strip = static_cast<float>(kSeam * grid.level(key.level).spacing);
    if (coarser) border.describe(v);
    return v;
  }

  enum class Ranges { read, known };

  /// Which samples are needed; nullopt means all. That is so if the bricks are resident anyway, or
  /// if the ranges are unknown and may not be read. It is so with NaN, too: blocks on different
  /// sides may then be neighbours without a surface between them.
  std::optional<NeededSamples> needed_of(const NodeKey& key, double isovalue, std::uint32_t coarser,
                                         Ranges ranges = Ranges::read) const {
    if (key.level != 0 || view.may_have_nan) return std::nullopt;
    if (bricks.resident(0, samples.bricks(0, points_around(key)))) return std::nullopt;
    const Box3 own = points(key);
    const Int3 first = floor_div(own.lo, {kBlockEdge, kBlockEdge, kBlockEdge});
    const auto table = ranges == Ranges::read ? bricks.block_ranges(0, first)
                                              : bricks.known_block_ranges(0, first);
    if (!table) return std::nullopt;
    return NeededSamples(own, *table, isovalue, coarser);
  }

  /// The needed ones of the bricks that hold the points `box` of the node.
  std::vector<Int3> bricks_of(const NodeKey& key, Box3 box,
                              const std::optional<NeededSamples>& needed) const {
    const auto stored = static_cast<std::size_t>(grid.level(key.level).source);
    const Lattice& lattice = bricks.source().info().levels[stored].lattice;
    std::vector<Int3> found;
    for_each_point(samples.bricks(key.level, box), [&](Int3 b) {
      if (!needed || needed->any(intersect(box, lattice.full_brick_box(b)))) found.push_back(b);
    });
    return found;
  }

  /// Whether a node's grid can hold stored samples: its points are samples, no border has a
  /// neighbour's values, and the type is smaller than a value.
  bool may_be_stored(const NodeKey& key, std::uint32_t coarser) const {
    const ScalarType type = bricks.source().info().type;
    return key.level == 0 && coarser == 0 && size_of(type) < sizeof(float);
  }

  GridView read_stored(const NodeKey& key, double isovalue, const CancellationToken& token) {
    const std::optional<NeededSamples> needed = needed_of(key, isovalue, 0);
    around.points = points_around(key);
    samples.read_stored(around.points, token, stored_samples, needed ? &*needed : nullptr);
    GridView v = view_of(key, false, false);
    v.stored = {stored_samples.data(), bricks.source().info().type, isovalue};
    return v;
  }

  GridView read(const NodeKey& key, double isovalue, std::uint32_t coarser,
                const CancellationToken& token) {
    const std::optional<NeededSamples> needed = needed_of(key, isovalue, coarser);
    samples.read(key.level, points_around(key), isovalue, token, around,
                 needed ? &*needed : nullptr);
    if (coarser) {
      copy_field(points(key));
      border.apply(key, coarser, isovalue, token, field);
    }
    return view_of(key, coarser != 0);
  }

  /// Copies without spare capacity, since the mesh is kept for long.
  static void shrink(const Mesh& from, Mesh& to) {
    const auto copy = [](const auto& a, auto& b) {
      b.reserve(a.size());
      b.resize(a.size());
      std::copy(a.begin(), a.end(), b.begin());
    };
    copy(from.positions, to.positions);
    copy(from.normals, to.normals);
    copy(from.triangles, to.triangles);
  }
};

NodeMesher::NodeMesher(const NodeGrid& grid, ResidentBricks& bricks, Vec3d origin,
                       std::optional<Inside> inside)
    : impl_(std::make_unique<Impl>(grid, bricks, origin, inside)) {}
NodeMesher::~NodeMesher() = default;

NodeMesh NodeMesher::mesh(const NodeKey& key, double isovalue, std::uint32_t coarser,
                          const CancellationToken& token) {
  NodeMesh out;
  out.key = key;
  out.isovalue = isovalue;
  out.coarser = coarser;
  return extract(grid(key, isovalue, coarser, token), std::move(out));
}

NodeMesh NodeMesher::extract(const GridView& grid, NodeMesh mesh) {
  const auto start = Clock::now();
  mesh.seam_triangles = impl_->extractor.extract(grid, impl_->work);
  Impl::shrink(impl_->work, mesh.mesh);
  impl_->busy += Clock::now() - start;
  return mesh;
}

GridView NodeMesher::grid(const NodeKey& key, double isovalue, std::uint32_t coarser,
                          const CancellationToken& token, Form form) {
  if (form == Form::stored_if_possible && impl_->may_be_stored(key, coarser))
    return impl_->read_stored(key, isovalue, token);
  return impl_->read(key, isovalue, coarser, token);
}

bool NodeMesher::is_half_resident(const NodeKey& key, double isovalue,
                                  std::uint32_t coarser) const {
  const auto needed = impl_->needed_of(key, isovalue, coarser, Impl::Ranges::known);
  const int stored = impl_->grid.level(key.level).source;
  const Box3 points = impl_->points(key);
  if (!needed) return impl_->bricks.half_resident(stored, impl_->samples.bricks(key.level, points));
  return impl_->bricks.half_resident(stored, impl_->bricks_of(key, points, needed));
}

void NodeMesher::add_missing(const NodeKey& key, double isovalue, std::uint32_t coarser,
                             std::vector<StoredBrick>& missing) const {
  const auto needed = impl_->needed_of(key, isovalue, coarser, Impl::Ranges::known);
  const int stored = impl_->grid.level(key.level).source;
  for (const Int3 b : impl_->bricks_of(key, impl_->points(key), needed))
    if (!impl_->bricks.resident(stored, {b, b + Int3{1, 1, 1}}))
      missing.push_back({stored, b.z, b.y, b.x});
}

void NodeMesher::will_need(const NodeKey& key, double isovalue, std::uint32_t coarser) const {
  const std::optional<NeededSamples> needed = impl_->needed_of(key, isovalue, coarser);
  for (const Int3 b : impl_->bricks_of(key, impl_->points_around(key), needed))
    impl_->bricks.will_need(impl_->grid.level(key.level).source, b);
}

double NodeMesher::seconds() const { return std::chrono::duration<double>(impl_->busy).count(); }

}  // namespace isobrick
