#pragma once

#include <memory>
#include <optional>

#include <isobrick/surface_options.h>
#include "gpu/resident/device_volume_impl.h"
#include "gpu/tile/tile_kernel.h"

namespace isobrick::inline v0::gpu {

/// Where the mesh of a resident volume goes; what does not fit is not written.
struct MeshRoom {
  DeviceBuffer<Vec3f> positions, normals;
  DeviceBuffer<Triangle> triangles;
};

/// Launches the search for active tiles and the extraction of a resident volume, on the volume's
/// stream, and reads the report of what was made. Not thread-safe.
class ResidentLauncher {
 public:
  /// Throws UsageError for what the device cannot do.
  ResidentLauncher(DeviceVolume::Impl& volume, const SurfaceOptions& options,
                   const ResidentTuning& tuning);
  ~ResidentLauncher();

  /// Launches search and extraction at an isovalue. `last`: a mesh that this one is expected to be
  /// like. False where no sample reaches the isovalue, so that there is nothing to make.
  bool launch(double isovalue, const MeshRoom& room, const DeviceCounts& last);
  /// Waits for the report of the last launch, not for the end of the stream's work.
  DeviceCounts wait();

  /// Whether wait() has nothing to wait for.
  bool is_reported() const;

  /// Active tiles beyond this number are not begun.
  std::size_t tiles_with_room() const { return row_tables_.size(); }
  void make_row_tables(std::uint32_t count);
  /// Bytes that make_row_tables() takes beyond what is held.
  std::uint64_t bytes_of_row_tables(std::uint32_t count) const {
    return (count - row_tables_.size()) *
           (sizeof(RowTable) + (has_samples(options_) ? sizeof(SampleTable) : 0));
  }

  /// Whether the last launch wanted more blocks of an array than there is room for, and so made
  /// nothing.
  bool lacks_blocks() const { return volume_.array && volume_.array->lacks_room(wanted_blocks_); }
  /// Bytes that make_blocks() takes beyond what is held.
  std::uint64_t bytes_of_blocks() const {
    return volume_.array->bytes_to_make_room(wanted_blocks_);
  }
  void make_blocks() { volume_.array->make_room(wanted_blocks_); }

  const SurfaceOptions& options() const { return options_; }
  const Stream& stream() const { return volume_.stream; }
  std::uint64_t bytes() const;

 private:
  struct Counters;

  std::size_t search_blocks() const;
  Counters* counters() const { return reinterpret_cast<Counters*>(words_.data()); }
  bool is_above_all_samples(double isovalue) const;
  template <class Params>
  void set_region(Params& p) const;

  void launch_search(double isovalue);
  void launch_tiles(double isovalue, const MeshRoom& room, const DeviceCounts& last);
  LaunchEnd launch_end() const;
  TileKernel kernel_for(bool on_samples) const;
  LaunchShape shape_for(double isovalue, const DeviceCounts& last) const;
  bool read_report(DeviceCounts& counts, std::uint32_t& blocks) const;

  DeviceVolume::Impl& volume_;
  SurfaceOptions options_;
  ResidentTuning tuning_;
  LaunchShapes shapes_;
  /// Where a mesh may have vertices on samples: of the kernel that makes these.
  std::optional<LaunchShapes> on_samples_shapes_;
  std::uint32_t launches_ = 0, epoch_ = 0;
  std::uint32_t wanted_blocks_ = 0;  ///< of an array, by the last launch
  DeviceBuffer<CaseTable> cases_;
  DeviceBuffer<TileItem> items_;
  DeviceBuffer<std::uint32_t> slot_of_tile_;
  DeviceBuffer<OrderState> order_;
  DeviceBuffer<std::byte> words_;  ///< Counters, then the sums of the search
  DeviceBuffer<RowTable> row_tables_;
  DeviceBuffer<SampleTable> sample_tables_;
  DeviceBuffer<SampleWork> work_;
  DeviceBuffer<TrilinearWork> trilinear_work_;
  DeviceBuffer<TopologyTables> topology_;
  std::shared_ptr<PinnedBuffer<LaunchReport>> report_;
};

}  // namespace isobrick::gpu
