#include "gpu/grid/grid_batch.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <vector>

#include <isobrick/error.h>
#include "gpu/grid/grid_kernel.h"
#include "gpu/memory/arena.h"
#include "gpu/memory/device_buffer.h"
#include "gpu/memory/nvtx_range.h"
#include "gpu/memory/pinned_buffer.h"
#include "surface/case_tables.h"

namespace isobrick::inline v0::gpu {
namespace {

using Clock = std::chrono::steady_clock;

/// Meshes of all slots take half of that.
constexpr std::chrono::milliseconds kAwake{1};

/// With a layer of points on every side.
constexpr std::size_t kAround = kGridPoints + 2,
                      kVertices = 3 * kGridRows * std::size_t{kGridPoints};
/// What aligning takes of all arrays that are sent.
constexpr std::size_t kGaps = 32 * Arena::kAlign;
/// Of a grid that is sent: both kinds of values, faces, places of all kinds, and gaps. Stored
/// samples and the values that are made of them take less.
constexpr std::size_t kSent =
    Arena::aligned(4 * (kAround * kAround * kAround + kGridRows * kGridPoints) + 4 * 6 * kGridRows +
                   3 * 20 * kAround + kGaps);
/// The largest stored samples.
constexpr std::size_t kLargestStored = 2;
static_assert((4 + kLargestStored) * kAround * kAround * kAround + 3 * 12 * kAround + kGaps <=
              kSent);

/// Takes what the work on one grid needs on the device. The grid itself comes last.
std::byte* take_slot(Arena& memory, GridWork& work) {
  work.rows = memory.take<GridRow>(kGridRows);
  work.counts = memory.take<std::uint32_t>(4 * kGridRows);
  work.faces = memory.take<std::uint8_t>(kVertices);
  work.seam_of = memory.take<std::uint32_t>(kVertices);
  work.totals = memory.take<GridTotals>(1);
  return memory.take<std::byte>(kSent);
}
std::size_t slot_bytes() {
  Arena measure;
  GridWork work;
  take_slot(measure, work);
  return Arena::aligned(measure.used());
}

GridMeshSize size_of(const GridTotals& t) {
  return {t.vertices + 2 * t.border_vertices, t.triangles + 2 * t.seam_sides, 2 * t.seam_sides};
}

/// A cell with a triangle that meets a coarser grid, of stored samples: all kernels have work.
struct SmallGrid {
  std::array<std::uint8_t, 8> samples{0, 1, 1, 1, 1, 1, 1, 1};
  std::array<double, 2> places{0, 1};
  std::array<float, 2> inverse{1, 1};
  std::array<float, 4> face{-1, 1, 1, 1};
  GridView view;

  SmallGrid() {
    view.stored = {samples.data(), ScalarType::u8, 0.5};
    view.row = 2;
    view.plane = 4;
    for (int axis = 0; axis < 3; ++axis) {
      view.n[axis] = view.around_n[axis] = view.coarse_n[axis] = 2;
      view.place[axis] = view.coarse_place[axis] = places.data();
      view.inverse[axis] = inverse.data();
    }
    view.faces[0] = {face.data(), {2, 2}};
  }
};

}  // namespace

struct GridBatch::Impl {
  /// What is known of a grid that was staged.
  struct Slot {
    std::byte *staging = nullptr, *sent = nullptr;  ///< the grid in pinned memory, on the device
    std::size_t sent_bytes = 0;
    GridWork work{};
  };

  Stream stream;
  Event done{cudaEventBlockingSync | cudaEventDisableTiming};
  DeviceBuffer<CaseTables> tables{2, stream};
  DeviceBuffer<GridWork> works;
  DeviceBuffer<std::byte> memory;
  PinnedBuffer<std::byte> staging;
  PinnedBuffer<GridWork> sent_works;
  PinnedBuffer<GridTotals> totals;
  std::vector<Slot> slots;

  explicit Impl(std::size_t count)
      : works(count, stream),
        memory(count * slot_bytes(), stream),
        staging(count * kSent),
        sent_works(count),
        totals(count),
        slots(count) {
    Arena arena(memory.data(), memory.size());
    for (std::size_t i = 0; i < count; ++i) {
      Slot& slot = slots[i];
      slot.sent = take_slot(arena, slot.work);
      slot.work.host_totals = totals.on_device() + i;
      slot.staging = staging.data() + i * kSent;
    }
    const auto send_tables = [&](const CaseTables& from, std::size_t at) {
      check(cudaMemcpyAsync(tables.data() + at, &from, sizeof(CaseTables), cudaMemcpyHostToDevice,
                            stream.get()));
    };
    send_tables(kCaseTables, 0);
    send_tables(kMirroredCaseTables, 1);
    wait();
  }

  Slot& at(int slot) { return slots[static_cast<std::size_t>(slot)]; }

  /// Awake at first: where all cores are at work a thread that sleeps is woken late, when another
  /// one's share of time is over, which takes milliseconds.
  void wait() {
    done.record(stream);
    const auto end = Clock::now() + kAwake;
    cudaError_t state = cudaErrorNotReady;
    while (state == cudaErrorNotReady && Clock::now() < end) state = cudaEventQuery(done.get());
    if (state != cudaErrorNotReady) return check(state);
    (void)cudaGetLastError();  // that it was not ready is none
    done.wait();
  }

  void stage(Slot& slot, const GridView& g) const {
    Arena staged(slot.staging, kSent), sent(slot.sent, kSent);
    // Stages an array; where it will be on the device.
    const auto send = [&]<class T>(const T* from, std::size_t count) -> const T* {
      std::memcpy(staged.take<T>(count), from, count * sizeof(T));
      return sent.take<T>(count);
    };
    slot.work.meets_coarser = g.meets_coarser();
    slot.work.tables = tables.data() + (g.map.mirrored ? 1 : 0);
    GridView& there = slot.work.grid;
    there = g;
    const auto points = [](const int(&n)[3]) {
      return static_cast<std::size_t>(n[0]) * static_cast<std::size_t>(n[1]) *
             static_cast<std::size_t>(n[2]);
    };
    const std::size_t around = points(g.around_n);
    if (g.stored.samples != nullptr) {
      if (size_of(g.stored.type) > kLargestStored)
        throw Error("a device's grids are made of stored samples of one or two bytes");
      const auto* samples = static_cast<const std::byte*>(g.stored.samples);
      there.stored.samples = send(samples, around * size_of(g.stored.type));
    } else {
      there.around = send(g.around, around);
      const bool within = g.values >= g.around && g.values < g.around + around;
      there.values = within ? there.around + (g.values - g.around) : send(g.values, points(g.n));
    }
    for (int axis = 0; axis < 3; ++axis) {
      const auto n = static_cast<std::size_t>(g.around_n[axis]);
      there.place[axis] = send(g.place[axis], n);
      there.inverse[axis] = send(g.inverse[axis], n);
      if (slot.work.meets_coarser)
        there.coarse_place[axis] =
            send(g.coarse_place[axis], static_cast<std::size_t>(g.coarse_n[axis]));
    }
    for (LodSeam& face : there.faces)
      if (face.values)
        face.values = send(face.values, static_cast<std::size_t>(face.n[0] * face.n[1]));
    slot.sent_bytes = sent.used();
    if (g.stored.samples == nullptr) return;
    there.around = sent.take<float>(around);
    there.values = there.around + (g.shift[2] * g.plane + g.shift[1] * g.row + g.shift[0]);
  }

  GridBatchWork send_works(std::span<const GridMeshJob> jobs) {
    GridBatchWork batch{works.data()};
    for (const GridMeshJob& job : jobs) {
      GridWork& work = at(job.slot).work;
      work.positions = job.place.arrays.positions;
      work.normals = job.place.arrays.normals;
      work.triangles = job.place.arrays.triangles;
      work.vertex_room = job.place.vertices;
      work.triangle_room = job.place.triangles;
      batch.max_rows = std::max(batch.max_rows, work.grid.n[1] * work.grid.n[2]);
      batch.any_meets_coarser |= work.meets_coarser;
      batch.any_stored |= work.grid.stored.samples != nullptr;
      sent_works[static_cast<std::size_t>(batch.count++)] = work;
    }
    check(cudaMemcpyAsync(works.data(), sent_works.data(), jobs.size() * sizeof(GridWork),
                          cudaMemcpyHostToDevice, stream.get()));
    return batch;
  }
};

GridBatch::GridBatch(int device, int slots) {
  make_current(device);
  impl_ = std::make_unique<Impl>(static_cast<std::size_t>(slots));
  // The first launch of a kernel loads its code, which takes long.
  stage(0, SmallGrid().view);
  make(std::array{GridMeshJob{0, {}}});
  Mesh mesh;
  download(0, mesh);
}
GridBatch::~GridBatch() = default;

void GridBatch::stage(int slot, const GridView& grid) { impl_->stage(impl_->at(slot), grid); }

void GridBatch::make(std::span<const GridMeshJob> jobs) {
  if (jobs.empty()) return;
  const NvtxRange range("make grid meshes");
  Impl& i = *impl_;
  for (const GridMeshJob& job : jobs) {
    const Impl::Slot& slot = i.at(job.slot);
    check(cudaMemcpyAsync(slot.sent, slot.staging, slot.sent_bytes, cudaMemcpyHostToDevice,
                          i.stream.get()));
  }
  const GridBatchWork batch = i.send_works(jobs);
  launch_grid_values(batch, i.stream.get());
  launch_grid_count(batch, i.stream.get());
  launch_grid_mesh(batch, i.stream.get());
  i.wait();
}

GridMeshSize GridBatch::size(int slot) const {
  return size_of(impl_->totals[static_cast<std::size_t>(slot)]);
}

void GridBatch::write(std::span<const GridMeshJob> jobs) {
  if (jobs.empty()) return;
  const NvtxRange range("write grid meshes");
  launch_grid_mesh(impl_->send_works(jobs), impl_->stream.get());
  impl_->wait();
}

void GridBatch::download(int slot, Mesh& out) {
  const NvtxRange range("download");
  Impl& i = *impl_;
  const GridMeshSize size = this->size(slot);
  out.positions.resize(size.vertices);
  out.normals.resize(size.vertices);
  out.triangles.resize(size.triangles);
  if (size.vertices == 0) return;
  const DeviceBuffer<Vec3f> positions(size.vertices, i.stream), normals(size.vertices, i.stream);
  const DeviceBuffer<Triangle> faces(size.triangles, i.stream);
  write(std::array{GridMeshJob{
      slot, {{positions.data(), normals.data(), faces.data()}, size.vertices, size.triangles}}});
  const auto copy = [&](void* to, const auto& from) {
    check(cudaMemcpyAsync(to, from.data(), from.bytes(), cudaMemcpyDeviceToHost, i.stream.get()));
  };
  copy(out.positions.data(), positions);
  copy(out.normals.data(), normals);
  copy(out.triangles.data(), faces);
  i.wait();
}

}  // namespace isobrick::gpu
