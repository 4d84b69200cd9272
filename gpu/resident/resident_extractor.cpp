#include <cmath>
#include <limits>

#include <isobrick/error.h>
#include "gpu/memory/nvtx_range.h"
#include "gpu/resident/device_volume_impl.h"
#include "gpu/resident/resident_launcher.h"

namespace isobrick::gpu {
namespace {

/// Mesh to expect of a tile before anything is known: a sheet across it, twice.
constexpr std::uint64_t kVerticesOfTile = 2500, kTrianglesOfTile = 5000;

}  // namespace

struct ResidentExtractor::Impl {
  ResidentLauncher launcher;
  MeshRoom room;
  double isovalue = 0;
  DeviceCounts made;  ///< by the last extraction
  DeviceCounts last;  ///< what the last launch would have made
  Event start, end;

  Impl(DeviceVolume& volume, const SurfaceOptions& options, const ResidentTuning& tuning)
      : launcher(volume.impl(), options, tuning) {}

  /// Buffers for a mesh of that size. What they held is lost.
  void make_room(std::uint64_t vertices, std::uint64_t triangles) {
    const Stream& stream = launcher.stream();
    made = {};
    if (vertices > room.positions.size()) {
      room.positions = {};
      room.normals = {};
      if (launcher.options().normals) room.normals = DeviceBuffer<Vec3f>(vertices, stream);
      room.positions = DeviceBuffer<Vec3f>(vertices, stream);  // last: its size is the capacity
    }
    if (triangles > room.triangles.size()) {
      room.triangles = {};
      room.triangles = DeviceBuffer<Triangle>(triangles, stream);
    }
  }

  DeviceCounts extract(double value) {
    if (std::isnan(value)) throw UsageError("the isovalue is not a number");
    isovalue = value;
    made = make();
    return made;
  }

  DeviceCounts make() {
    // Tiles without a row table are not begun: the first launch reports how many there are.
    for (;;) {
      if (!launcher.launch(isovalue, room, last)) return {};
      last = launcher.wait();
      const bool begun = last.active_tiles <= launcher.tiles_with_room();
      launcher.make_row_tables(last.active_tiles);
      if (!begun || (last.active_tiles > 0 && room.positions.size() == 0)) {
        make_room(kVerticesOfTile * last.active_tiles, kTrianglesOfTile * last.active_tiles);
        continue;
      }
      if (last.vertices > std::numeric_limits<std::uint32_t>::max())
        throw Error(
            "the mesh has more than 4294967295 vertices, which an indexed mesh of 32 bits cannot "
            "number; extract it in parts with --roi");
      if (last.vertices <= room.positions.size() && last.triangles <= room.triangles.size())
        return last;
      make_room(last.vertices, last.triangles);
    }
  }

  void repeat() {
    const Stream& stream = launcher.stream();
    start.record(stream);
    launcher.launch(isovalue, room, last);
    end.record(stream);
  }

  void download(MeshBuffer& mesh) {
    const NvtxRange range("download");
    launcher.stream().wait();
    mesh.clear();
    mesh.positions.resize(made.vertices);
    mesh.triangles.resize(made.triangles);
    if (launcher.options().normals) mesh.normals.resize(made.vertices);
    const auto copy = [](auto& to, const auto& from) {
      if (to.size() > 0)
        check(cudaMemcpy(to.data(), from.data(), to.size() * sizeof(*to.data()),
                         cudaMemcpyDeviceToHost));
    };
    copy(mesh.positions, room.positions);
    copy(mesh.normals, room.normals);
    copy(mesh.triangles, room.triangles);
  }
};

ResidentExtractor::ResidentExtractor(DeviceVolume& volume, const SurfaceOptions& options,
                                     const ResidentTuning& tuning)
    : impl_(std::make_unique<Impl>(volume, options, tuning)) {}
ResidentExtractor::~ResidentExtractor() = default;

DeviceCounts ResidentExtractor::extract(double isovalue) { return impl_->extract(isovalue); }
void ResidentExtractor::repeat() { impl_->repeat(); }

float ResidentExtractor::milliseconds() {
  impl_->end.wait();
  return impl_->end.since(impl_->start);
}

void ResidentExtractor::download(MeshBuffer& mesh) const { impl_->download(mesh); }

std::uint64_t ResidentExtractor::bytes() const {
  const MeshRoom& room = impl_->room;
  return impl_->launcher.bytes() + room.positions.bytes() + room.normals.bytes() +
         room.triangles.bytes();
}

}  // namespace isobrick::gpu
