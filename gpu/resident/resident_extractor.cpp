#include <fmt/format.h>
#include <tbb/concurrent_queue.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <isobrick/error.h>
#include "core/stopwatch.h"
#include "gpu/memory/nvtx_range.h"
#include "gpu/resident/device_mesh_impl.h"
#include "gpu/resident/device_volume_impl.h"
#include "gpu/resident/resident_launcher.h"
#include "gpu/resident/resident_sizes.h"
#include "surface/chunk_writer.h"
#include "surface/surface_extractor.h"

namespace isobrick::inline v0::gpu {
namespace {

/// Mesh to make room for before anything is known: a sheet across each tile, twice.
constexpr MeshSize kRoomOfTile{2500, 5000};

/// A vertex with its normal.
constexpr std::size_t kMinChunk = 2 * sizeof(Vec3f);

MeshSize larger(MeshSize a, MeshSize b) {
  return {std::max(a.vertices, b.vertices), std::max(a.triangles, b.triangles)};
}

MeshSize room_for(std::uint32_t tiles) {
  return {tiles * kRoomOfTile.vertices, tiles * kRoomOfTile.triangles};
}

}  // namespace

struct ResidentExtractor::Impl {
  int device = 0;
  ResidentLauncher launcher;
  std::uint64_t max_bytes;
  std::uint64_t tile_bytes;  ///< of samples
  MeshRoom room;
  double isovalue = 0;
  MeshSize taken;  ///< the room that the last taken mesh had
  bool is_launched = false;
  Stopwatch since_begin;
  DeviceCounts made;  ///< by the last extraction
  DeviceCounts last;  ///< what the last launch would have made
  SurfaceReport report;
  PinnedBuffer<std::byte> chunks[2];  ///< on their way to a sink
  Event start, end;

  Impl(DeviceVolume& volume, const SurfaceOptions& options, const ResidentTuning& tuning,
       std::uint64_t most)
      : launcher(volume.impl(), options, tuning),
        max_bytes(most),
        tile_bytes(kTileBlockSamples * volume.lattice().sample_bytes()) {
    check(cudaGetDevice(&device));
  }

  const Stream& stream() const { return launcher.stream(); }
  bool normals() const { return launcher.options().normals; }
  MeshSize size_of_room() const { return {room.positions.size(), room.triangles.size()}; }
  std::uint64_t bytes() const { return launcher.bytes() + mesh_bytes(size_of_room(), normals()); }

  /// Buffers for `needed`, or for `wanted` where the bound leaves room. What they held is lost.
  void make_room(MeshSize needed, MeshSize wanted) {
    for (const MeshSize size : {larger(wanted, size_of_room()), needed})
      if (launcher.bytes() + mesh_bytes(size, normals()) <= max_bytes) return allocate(size);
    throw OutOfDeviceMemory("the mesh does not fit the device beside the volume");
  }

  void allocate(MeshSize size) {
    made = {};
    const MeshSize now = size_of_room();
    const bool vertices = size.vertices != now.vertices,
               triangles = size.triangles != now.triangles;
    if (!vertices && !triangles) return;
    if (vertices) {
      room.positions = {};
      room.normals = {};
    }
    if (triangles) room.triangles = {};
    // The driver has the memory back before it is asked for more.
    if (now.vertices + now.triangles > 0) stream().wait();
    if (vertices && normals()) room.normals = {size.vertices, stream()};
    if (vertices) room.positions = {size.vertices, stream()};  // last: its size is the capacity
    if (triangles) room.triangles = {size.triangles, stream()};
  }

  void make_blocks() {
    if (bytes() + launcher.bytes_of_blocks() > max_bytes) allocate({});
    if (bytes() + launcher.bytes_of_blocks() > max_bytes)
      throw OutOfDeviceMemory("the samples that the surface touches do not fit the device");
    launcher.make_blocks();
  }

  void make_row_tables(std::uint32_t tiles) {
    const std::uint64_t more = launcher.bytes_of_row_tables(tiles);
    if (bytes() + more > max_bytes) allocate({});
    if (bytes() + more > max_bytes)
      throw OutOfDeviceMemory("the row tables do not fit the device beside the volume");
    launcher.make_row_tables(tiles);
  }

  void begin(double value) {
    if (std::isnan(value)) throw UsageError("the isovalue is not a number");
    isovalue = value;
    report = {};
    made = {};  // a launch that fails leaves no mesh
    is_launched = false;
    (void)since_begin.lap();
    if (taken.vertices > 0 && size_of_room().vertices == 0) make_room({}, taken);
    launch();
  }

  DeviceCounts finish() {
    made = make();
    is_launched = false;
    report.vertices = made.vertices;
    report.triangles = made.triangles;
    report.degenerate_triangles = made.degenerate_triangles;
    report.kernel = {since_begin.lap(), made.active_tiles * tile_bytes +
                                            mesh_bytes({made.vertices, made.triangles}, normals())};
    return made;
  }

  void launch() {
    is_launched = launcher.launch(isovalue, room, last);
    report.launches += is_launched;
  }

  DeviceMesh take_mesh(const std::string& unit) {
    if (made.triangles == 0 && made.vertices == 0) return {};
    taken = size_of_room();
    auto mesh =
        std::make_shared<DeviceMesh::Impl>(device, stream(), std::exchange(room, {}), made, unit);
    made = {};
    return DeviceMesh(std::move(mesh));
  }

  DeviceCounts make() {
    for (;; launch()) {
      if (!is_launched) return {};
      last = launcher.wait();
      const MeshSize expected =
          room.positions.size() == 0 ? room_for(last.active_tiles) : MeshSize{};
      // Tiles without a row table are not begun: the first launch reports how many there are.
      const bool lacks_tables = last.active_tiles > launcher.tiles_with_room();
      const bool lacks_blocks = launcher.lacks_blocks();
      if (lacks_blocks) make_blocks();
      if (lacks_tables) {
        make_row_tables(last.active_tiles);
        make_room({}, expected);
      }
      if (lacks_blocks || lacks_tables) continue;
      if (last.vertices > std::numeric_limits<std::uint32_t>::max())
        throw Error(
            "the mesh has more than 4294967295 vertices, which an indexed mesh of 32 bits cannot "
            "number; extract it by way of pieces (--resume) or by regions (--roi)");
      if (last.vertices <= room.positions.size() && last.triangles <= room.triangles.size())
        return last;
      const MeshSize needed{last.vertices, last.triangles};
      make_room(needed, larger(needed, expected));
      ++report.repeats;
    }
  }

  bool is_over() const { return !is_launched || launcher.is_reported(); }

  void repeat() {
    start.record(stream());
    launcher.launch(isovalue, room, last);
    end.record(stream());
  }

  void download(Mesh& mesh) {
    const NvtxRange range("download");
    stream().wait();
    mesh.clear();
    mesh.positions.resize(made.vertices);
    mesh.triangles.resize(made.triangles);
    if (normals()) mesh.normals.resize(made.vertices);
    const auto copy = [](auto& to, const auto& from) {
      if (to.size() > 0)
        check(cudaMemcpy(to.data(), from.data(), to.size() * sizeof(*to.data()),
                         cudaMemcpyDeviceToHost));
    };
    copy(mesh.positions, room.positions);
    copy(mesh.normals, room.normals);
    copy(mesh.triangles, room.triangles);
  }

  template <class V>
  void copy(V* to, const V* from, std::size_t count) const {
    check(cudaMemcpyAsync(to, from, count * sizeof(V), cudaMemcpyDeviceToHost, stream().get()));
  }

  void reserve_chunks(std::size_t chunk_bytes) {
    if (chunk_bytes < kMinChunk)
      throw UsageError(fmt::format("a chunk of a mesh has at least {} bytes", kMinChunk));
    for (PinnedBuffer<std::byte>& chunk : chunks)
      if (chunk.size() != chunk_bytes) chunk = PinnedBuffer<std::byte>(chunk_bytes);
    report.pinned_bytes = 2 * chunk_bytes;
  }

  void write(MeshSink& sink, std::size_t chunk_bytes) {
    make_current(device);
    const NvtxRange range("download");
    reserve_chunks(chunk_bytes);
    tbb::concurrent_bounded_queue<std::byte*> free;
    for (const PinnedBuffer<std::byte>& chunk : chunks) free.push(chunk.data());
    ChunkWriter writer(sink);  // ends before the queue that its chunks go back to
    // Calls copy_chunk(to, first, count) for chunks of items, which returns the chunk.
    const auto write_all = [&](std::uint64_t items, std::size_t item_bytes,
                               const auto& copy_chunk) {
      const std::uint64_t at_once = chunk_bytes / item_bytes;
      for (std::uint64_t first = 0; first < items; first += at_once) {
        std::byte* to = nullptr;
        free.pop(to);
        Stopwatch watch;
        const MeshChunk chunk = copy_chunk(to, first, std::min(at_once, items - first));
        stream().wait();
        report.download.seconds += watch.lap();
        writer.write(chunk, [&free, to] { free.push(to); });
      }
    };
    write_all(made.vertices, sizeof(Vec3f) * (normals() ? 2 : 1),
              [&](std::byte* to, std::uint64_t first, std::uint64_t count) {
                auto* const positions = reinterpret_cast<Vec3f*>(to);
                copy(positions, room.positions.data() + first, count);
                if (!normals()) return MeshChunk{first, {positions, count}, {}, {}};
                copy(positions + count, room.normals.data() + first, count);
                return MeshChunk{first, {positions, count}, {positions + count, count}, {}};
              });
    write_all(made.triangles, sizeof(Triangle),
              [&](std::byte* to, std::uint64_t first, std::uint64_t count) {
                auto* const triangles = reinterpret_cast<Triangle*>(to);
                copy(triangles, room.triangles.data() + first, count);
                return MeshChunk{made.vertices, {}, {}, {triangles, count}};
              });
    writer.finish();
    report.sink = writer.report();
    report.download.bytes = report.sink.bytes;
  }
};

ResidentExtractor::ResidentExtractor(DeviceVolume& volume, const SurfaceOptions& options,
                                     const ResidentTuning& tuning, std::uint64_t max_bytes)
    : impl_(std::make_unique<Impl>(volume, options, tuning, max_bytes)) {}
ResidentExtractor::~ResidentExtractor() = default;

DeviceCounts ResidentExtractor::extract(double isovalue) {
  begin(isovalue);
  return finish();
}
void ResidentExtractor::begin(double isovalue) { impl_->begin(isovalue); }
bool ResidentExtractor::is_over() const { return impl_->is_over(); }
DeviceCounts ResidentExtractor::finish() { return impl_->finish(); }
DeviceMesh ResidentExtractor::take_mesh(const std::string& unit) { return impl_->take_mesh(unit); }
void ResidentExtractor::repeat() { impl_->repeat(); }

float ResidentExtractor::milliseconds() {
  impl_->end.wait();
  return impl_->end.since(impl_->start);
}

void ResidentExtractor::download(Mesh& mesh) const { impl_->download(mesh); }

void ResidentExtractor::reserve_chunks(std::size_t chunk_bytes) {
  impl_->reserve_chunks(chunk_bytes);
}
void ResidentExtractor::write(MeshSink& sink, std::size_t chunk_bytes) {
  impl_->write(sink, chunk_bytes);
}

SurfaceReport ResidentExtractor::report() const {
  SurfaceReport report = impl_->report;
  report.device_bytes = bytes();
  return report;
}

std::uint64_t ResidentExtractor::bytes() const { return impl_->bytes(); }

}  // namespace isobrick::gpu
