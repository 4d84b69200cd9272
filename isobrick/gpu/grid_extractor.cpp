#include "isobrick/gpu/grid_extractor.h"

#include <cstring>

#include "isobrick/gpu/grid_kernel.h"
#include "isobrick/gpu/stream.h"
#include "isobrick/surface/case_tables.h"

namespace isobrick::gpu {
namespace {

/// With a layer of points on every side.
constexpr std::size_t kAround = kGridPoints + 2,
                      kVertices = 3 * kGridRows * std::size_t{kGridPoints};
/// Of a grid that is sent: both kinds of values, faces, places of all kinds, and what
/// aligning takes.
constexpr std::size_t kSent = 4 * (kAround * kAround * kAround + kGridRows * kGridPoints) +
                              4 * 6 * kGridRows + 3 * 20 * kAround + 32 * 64;

constexpr std::size_t aligned(std::size_t bytes) { return (bytes + 63) / 64 * 64; }

/// Memory that is cut from the front.
class Cutter {
 public:
  explicit Cutter(std::byte* data) : data_(data) {}
  template <class T>
  T* take(std::size_t count) {
    std::byte* at = data_ + used_;
    used_ += aligned(count * sizeof(T));
    return reinterpret_cast<T*>(at);
  }

 private:
  std::byte* data_;
  std::size_t used_ = 0;
};

/// All that work on the device takes.
constexpr std::size_t kWorkBytes =
    aligned(sizeof(CaseTables)) + aligned(sizeof(GridTotals)) +
    aligned(kGridRows * sizeof(GridRow)) + aligned(4 * kGridRows * sizeof(std::uint32_t)) +
    aligned(kVertices) + aligned(kVertices * sizeof(std::uint32_t)) + aligned(kSent);

}  // namespace

struct GridExtractor::Impl {
  Stream stream;
  PinnedBuffer<std::byte> staging{kSent};
  MappedHost<GridTotals> totals;
  DeviceBuffer<std::byte> memory{kWorkBytes, stream};
  std::byte* sent = nullptr;  ///< on the device
  GridWork work{};
  bool mirrored = false, tables_there = false, meets_coarser = false;
  CaseTables* tables = nullptr;

  Impl() {
    Cutter cut(memory.data());
    tables = cut.take<CaseTables>(1);
    work.tables = tables;
    work.rows = cut.take<GridRow>(kGridRows);
    work.counts = cut.take<std::uint32_t>(4 * kGridRows);
    work.faces = cut.take<std::uint8_t>(kVertices);
    work.ribbon_of = cut.take<std::uint32_t>(kVertices);
    work.totals = cut.take<GridTotals>(1);
    sent = cut.take<std::byte>(kSent);
    work.host_totals = totals.on_device();
  }

  void send_tables(bool left_handed) {
    if (tables_there && mirrored == left_handed) return;
    check(cudaMemcpyAsync(tables, left_handed ? &kMirroredCaseTables : &kCaseTables,
                          sizeof(CaseTables), cudaMemcpyHostToDevice, stream.get()));
    mirrored = left_handed;
    tables_there = true;
  }

  /// Copies an array to the staging; where it will be on the device.
  template <class T>
  const T* stage(const T* from, std::size_t count, std::size_t& used) {
    std::memcpy(staging.data() + used, from, count * sizeof(T));
    const auto* at = reinterpret_cast<const T*>(sent + used);
    used += aligned(count * sizeof(T));
    return at;
  }

  void launch_mesh(const GridMeshPlace& place) {
    if (place.vertices == 0) return;
    work.positions = place.positions;
    work.normals = place.normals;
    work.triangles = place.triangles;
    work.vertex_room = place.vertices;
    work.triangle_room = place.triangle_count;
    launch_grid_mesh(work, meets_coarser, stream.get());
  }

  void send(const GridView& g) {
    GridView& there = work.grid;
    there = g;
    std::size_t used = 0;
    const auto points = [](const int(&n)[3]) {
      return static_cast<std::size_t>(n[0]) * static_cast<std::size_t>(n[1]) *
             static_cast<std::size_t>(n[2]);
    };
    const std::size_t around = points(g.around_n);
    there.around = stage(g.around, around, used);
    const bool within = g.values >= g.around && g.values < g.around + around;
    there.values =
        within ? there.around + (g.values - g.around) : stage(g.values, points(g.n), used);
    for (int axis = 0; axis < 3; ++axis) {
      const auto n = static_cast<std::size_t>(g.around_n[axis]);
      there.place[axis] = stage(g.place[axis], n, used);
      there.inverse[axis] = stage(g.inverse[axis], n, used);
      if (meets_coarser)
        there.coarse_place[axis] =
            stage(g.coarse_place[axis], static_cast<std::size_t>(g.coarse_n[axis]), used);
    }
    for (CoarseFace& face : there.faces)
      if (face.values)
        face.values = stage(face.values, static_cast<std::size_t>(face.n[0] * face.n[1]), used);
    check(cudaMemcpyAsync(sent, staging.data(), used, cudaMemcpyHostToDevice, stream.get()));
  }
};

GridExtractor::GridExtractor(int device) {
  check(cudaSetDevice(device));
  impl_ = std::make_unique<Impl>();
}
GridExtractor::~GridExtractor() = default;

GridExtractor::Size GridExtractor::make(const GridView& grid, const GridMeshPlace& place) {
  Impl& i = *impl_;
  i.meets_coarser = grid.meets_coarser();
  i.send_tables(grid.map.mirrored);
  i.send(grid);
  launch_grid_count(i.work, i.meets_coarser, i.stream.get());
  i.launch_mesh(place);
  i.stream.wait();
  const GridTotals& t = *i.totals;
  return {t.vertices + 2 * t.border_vertices, t.triangles + 2 * t.ribbon_sides, 2 * t.ribbon_sides};
}

void GridExtractor::write(const GridMeshPlace& place) {
  impl_->launch_mesh(place);
  impl_->stream.wait();
}

void GridExtractor::download(MeshBuffer& out) {
  Impl& i = *impl_;
  const GridTotals& t = *i.totals;
  const std::uint32_t vertices = t.vertices + 2 * t.border_vertices;
  const std::uint32_t triangles = t.triangles + 2 * t.ribbon_sides;
  out.positions.resize(vertices);
  out.normals.resize(vertices);
  out.triangles.resize(triangles);
  if (vertices == 0) return;
  const DeviceBuffer<Vec3f> positions(vertices, i.stream), normals(vertices, i.stream);
  const DeviceBuffer<Triangle> faces(triangles, i.stream);
  write({positions.data(), normals.data(), faces.data(), vertices, triangles});
  const auto copy = [&](void* to, const auto& from) {
    check(cudaMemcpyAsync(to, from.data(), from.bytes(), cudaMemcpyDeviceToHost, i.stream.get()));
  };
  copy(out.positions.data(), positions);
  copy(out.normals.data(), normals);
  copy(out.triangles.data(), faces);
  i.stream.wait();
}

}  // namespace isobrick::gpu
