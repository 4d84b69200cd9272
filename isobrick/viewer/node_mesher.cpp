#include "isobrick/viewer/node_mesher.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <vector>

#include "isobrick/core/error.h"
#include "isobrick/surface/cpu_extractor.h"
#include "isobrick/viewer/node_border.h"

namespace isobrick {
namespace {

using Clock = std::chrono::steady_clock;

/// Half the width of a ribbon, in cells: enough for what a rasteriser rounds, too
/// little to be seen.
constexpr double kRibbon = 0.02;
constexpr std::uint32_t kNone = ~std::uint32_t{0};

/// The grid points of a node as one brick.
class OneBrick final : public BrickLookup {
 public:
  explicit OneBrick(const GridValues& field) : field_(field) {}
  const std::byte* find(Int3) const override {
    return reinterpret_cast<const std::byte*>(field_.values.data());
  }

 private:
  const GridValues& field_;
};

Vec3f to_float(Vec3d v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

double length(Vec3d v) { return std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z); }

}  // namespace

struct NodeMesher::Impl {
  const NodeGrid& grid;
  ResidentBricks& bricks;
  Vec3d origin;
  bool may_have_nan, mirrored;
  NodeSamples samples;
  NodeBorder border;
  GridValues around, field;  ///< with a layer around for gradients; with neighbours' values
  std::optional<CpuExtractor> extractor;
  Int3 extractor_extent;
  std::vector<double> places[3];         ///< of the points of `around`, level-0 index space
  std::vector<std::uint8_t> on_face;     ///< of each vertex: bit f, it lies on face f
  std::vector<std::uint32_t> ribbon_of;  ///< of each vertex: its outer ribbon vertex
  Clock::duration busy{};

  Impl(const NodeGrid& g, ResidentBricks& b, Vec3d o)
      : grid(g),
        bricks(b),
        origin(o),
        may_have_nan(b.source().info().may_have_nan),
        samples(g, b),
        border(g, samples) {
    const auto& d = g.transform().direction;
    const Vec3d s = g.transform().spacing;
    const double handed = d[0] * (d[4] * d[8] - d[5] * d[7]) - d[1] * (d[3] * d[8] - d[5] * d[6]) +
                          d[2] * (d[3] * d[7] - d[4] * d[6]);
    mirrored = handed * s.x * s.y * s.z < 0;
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

  bool crosses() const {
    bool inside = false, outside = false;
    for (const float v : field.values) {
      inside |= v >= 0;
      outside |= v < 0;
    }
    return inside && outside;
  }

  /// In grid space of the node.
  void extract(MeshBuffer& out) {
    const Int3 extent = field.points.extent();
    const Lattice lattice{extent, extent, ScalarType::f32};
    if (!extractor || !(extractor_extent == extent)) {
      SurfaceOptions options;
      options.roi = lattice.box();
      options.may_have_nan = may_have_nan;
      extractor.emplace(lattice, options, ExtractorLimits{.tiles = 4});
      extractor_extent = extent;
    }
    extractor->restart();
    std::vector<TileWork> tiles;
    const Int3 edge{kTileEdge, kTileEdge, kTileEdge};
    for_each_point({{0, 0, 0}, ceil_div(extent - Int3{1, 1, 1}, edge)}, [&](Int3 tile) {
      tiles.push_back({tile, 0xff});
    });
    // Few at a time, so that they stay on this thread.
    const OneBrick brick(field);
    for (std::size_t i = 0; i < tiles.size(); i += 4)
      extractor->extract(std::span(tiles).subspan(i, std::min<std::size_t>(4, tiles.size() - i)),
                         brick, out);
  }

  double place(int axis, Index point) const {
    return places[axis][static_cast<std::size_t>(point - around.points.lo[axis])];
  }

  Vec3d gradient(Int3 p) const {
    Vec3d g;
    for (int axis = 0; axis < 3; ++axis) {
      Int3 a = p, b = p;
      a[axis] = std::max(p[axis] - 1, around.points.lo[axis]);
      b[axis] = std::min(p[axis] + 1, around.points.hi[axis] - 1);
      g[axis] = (static_cast<double>(around.at(b)) - static_cast<double>(around.at(a))) /
                (place(axis, b[axis]) - place(axis, a[axis]));
    }
    return g;
  }

  Vec3d to_world(Vec3d v) const {
    const auto& d = grid.transform().direction;
    return {d[0] * v.x + d[1] * v.y + d[2] * v.z, d[3] * v.x + d[4] * v.y + d[5] * v.z,
            d[6] * v.x + d[7] * v.y + d[8] * v.z};
  }

  /// Outward unit normal of a vertex on the edge from grid point `below` on.
  Vec3f normal(Int3 below, Vec3d part) const {
    Vec3d g = gradient(below);
    for (int axis = 0; axis < 3; ++axis)
      if (part[axis] > 0) {
        Int3 next = below;
        ++next[axis];
        const Vec3d end = gradient(next);
        g = g + (end - g) * part[axis];
      }
    const Vec3d spacing = grid.transform().spacing;
    Vec3d n = to_world({-g.x / spacing.x, -g.y / spacing.y, -g.z / spacing.z});
    const double size = length(n);
    if (size > 0 && std::isfinite(size)) return to_float(n * (1 / size));
    return along_edge(below, part);
  }

  /// Where there is no gradient: from the inside end of the edge to the other one.
  Vec3f along_edge(Int3 below, Vec3d part) const {
    int axis = 0;
    for (int i = 0; i < 3; ++i)
      if (part[i] > 0) axis = i;
    Vec3d v;
    v[axis] =
        (field.at(below) >= 0 ? 1.0 : -1.0) * std::copysign(1.0, grid.transform().spacing[axis]);
    return to_float(to_world(v));
  }

  /// From grid space to where vertices belong.
  void finish_vertices(const NodeKey& key, std::uint32_t coarser, MeshBuffer& mesh) {
    const Int3 lo = field.points.lo, cells = grid.node_cells(key);
    const std::size_t count = mesh.positions.size();
    mesh.normals.resize(count);
    on_face.assign(coarser ? count : 0, 0);
    for (std::size_t i = 0; i < count; ++i) {
      Vec3d part, at;
      Int3 below;
      unsigned faces = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const auto q = static_cast<double>(mesh.positions[i][axis]);
        const auto local = static_cast<Index>(q);
        below[axis] = lo[axis] + local;
        part[axis] = q - static_cast<double>(local);
        at[axis] = place(axis, below[axis]);
        if (part[axis] > 0) at[axis] += part[axis] * (place(axis, below[axis] + 1) - at[axis]);
        if (part[axis] > 0) continue;
        if (local == 0) faces |= 1u << (2 * axis);
        if (local == cells[axis]) faces |= 2u << (2 * axis);
      }
      mesh.normals[i] = normal(below, part);
      if (coarser)
        for (int f = 0; f < 6; ++f)
          if (faces >> f & 1 && border.meets(f)) {
            at = border.moved(f, below, part, at);
            on_face[i] = static_cast<std::uint8_t>(on_face[i] | 1u << f);
          }
      mesh.positions[i] = to_float(grid.transform().apply(at) - origin);
    }
    if (mirrored)
      for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
  }

  /// The ribbon's two vertices at a vertex of the border; the number of the first.
  std::uint32_t ribbon_vertices(std::uint32_t vertex, float width, MeshBuffer& mesh) {
    std::uint32_t& first = ribbon_of[vertex];
    if (first != kNone) return first;
    first = static_cast<std::uint32_t>(mesh.positions.size());
    const Vec3f p = mesh.positions[vertex], n = mesh.normals[vertex];
    mesh.positions.resize(first + 2);
    mesh.normals.resize(first + 2);
    for (std::uint32_t side = 0; side < 2; ++side) {
      mesh.positions[first + side] = p + n * (side ? -width : width);
      mesh.normals[first + side] = n;
    }
    return first;
  }

  /// Vertices that lie on a line between two others to within rounding leave gaps
  /// that a rasteriser may see through.
  std::uint32_t add_ribbons(const NodeKey& key, MeshBuffer& mesh) {
    ribbon_of.assign(mesh.positions.size(), kNone);
    const auto width = static_cast<float>(kRibbon * grid.level(key.level).spacing);
    const std::size_t count = mesh.triangles.size();
    for (std::size_t t = 0; t < count; ++t)
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = mesh.triangles[t][k], b = mesh.triangles[t][(k + 1) % 3];
        if (!(on_face[a] & on_face[b])) continue;
        const std::uint32_t ra = ribbon_vertices(a, width, mesh);
        const std::uint32_t rb = ribbon_vertices(b, width, mesh);
        const std::size_t n = mesh.triangles.size();
        mesh.triangles.resize(n + 2);
        mesh.triangles[n] = {ra, rb, rb + 1};
        mesh.triangles[n + 1] = {ra, rb + 1, ra + 1};
      }
    return static_cast<std::uint32_t>(mesh.triangles.size() - count);
  }

  void make(NodeMesh& out, const Wanted& wanted) {
    samples.read(out.key.level, points_around(out.key), out.isovalue, wanted, around);
    copy_field(points(out.key));
    if (out.coarser) border.apply(out.key, out.coarser, out.isovalue, wanted, field);
    const auto start = Clock::now();
    if (crosses()) {
      for (int axis = 0; axis < 3; ++axis) {
        places[axis].clear();
        for (Index p = around.points.lo[axis]; p < around.points.hi[axis]; ++p)
          places[axis].push_back(static_cast<double>(grid.position(out.key.level, axis, p)));
      }
      MeshBuffer mesh;
      extract(mesh);
      finish_vertices(out.key, out.coarser, mesh);
      if (out.coarser) out.ribbon_triangles = add_ribbons(out.key, mesh);
      shrink(mesh, out.mesh);
    }
    busy += Clock::now() - start;
  }

  /// A copy without what growing left over: it is kept for long.
  static void shrink(const MeshBuffer& from, MeshBuffer& to) {
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

NodeMesher::NodeMesher(const NodeGrid& grid, ResidentBricks& bricks, Vec3d origin)
    : impl_(std::make_unique<Impl>(grid, bricks, origin)) {}
NodeMesher::~NodeMesher() = default;

NodeMesh NodeMesher::mesh(const NodeKey& key, double isovalue, std::uint32_t coarser,
                          const Wanted& wanted) {
  NodeMesh out;
  out.key = key;
  out.isovalue = isovalue;
  out.coarser = coarser;
  impl_->make(out, wanted);
  return out;
}

NodeMesher::Needs NodeMesher::needs(const NodeKey& key) const {
  return {impl_->grid.level(key.level).source,
          impl_->samples.bricks(key.level, impl_->points_around(key))};
}

double NodeMesher::seconds() const { return std::chrono::duration<double>(impl_->busy).count(); }

}  // namespace isobrick
