#pragma once

#include <optional>
#include <vector>

#include "isobrick/gpu/device_volume_impl.h"
#include "isobrick/gpu/host_search.h"
#include "isobrick/gpu/kernel_graph.h"
#include "isobrick/gpu/span_indices.h"
#include "isobrick/gpu/standing_launch.h"
#include "isobrick/gpu/tile_kernel.h"
#include "isobrick/surface/surface_options.h"

namespace isobrick::gpu {

/// Where the mesh of a resident volume goes; what does not fit is not written.
struct MeshRoom {
  DeviceBuffer<Vec3f> positions, normals;
  DeviceBuffer<Triangle> triangles;
};

/// Launches what makes a mesh of a resident volume, the search for active tiles included, on the
/// volume's stream, and hears of what has been made. Not thread-safe.
class ResidentLauncher {
 public:
  /// Throws UsageError for what the device cannot do.
  ResidentLauncher(DeviceVolume::Impl& volume, const SurfaceOptions& options,
                   const ResidentTuning& tuning);
  ~ResidentLauncher();

  /// Launches the extraction at an isovalue, or asks one that stands by. `last` is a mesh that
  /// this one is expected to be like; `stay`: more isovalues will come soon. False where it is
  /// known that there is nothing to make.
  bool launch(double isovalue, const MeshRoom& room, const DeviceCounts& last, bool stay);
  /// Waits for the last launch. None where the one that should have been it was gone when it was
  /// asked; it is to be launched again.
  std::optional<DeviceCounts> wait();
  /// Lets a launch that stands by go, which uses the room that it was given; also of another
  /// extractor of the volume.
  void dismiss();

  /// Active tiles beyond this number are not begun.
  std::size_t tiles_with_room() const { return row_tables_.size(); }
  void make_row_tables(std::uint32_t count);

  StandingLaunch& standing() { return standing_; }
  const SurfaceOptions& options() const { return options_; }
  const Stream& stream() const { return volume_.stream; }
  std::uint64_t bytes() const;

 private:
  struct Counters;

  bool are_few() const;
  std::uint32_t slabs() const;
  std::size_t search_blocks() const;
  Counters* counters() const { return reinterpret_cast<Counters*>(words_.data()); }
  std::vector<ValueRange<double>> ranges_to_search() const;
  void make_host_search();
  bool is_above_all_samples(double isovalue) const;
  template <class Params>
  void set_region(Params& p) const;

  void launch_search(double isovalue);
  bool ask_standing(double isovalue, const FoundTiles& found);
  void launch_tiles(double isovalue, const MeshRoom& room, const FoundTiles& found,
                    const DeviceCounts& last, bool stay);
  std::uint32_t expected_tiles(const FoundTiles& found, const DeviceCounts& last) const;
  void say_end(TileParams& p) const;
  LaunchShape shape_of(const FoundTiles& found, const DeviceCounts& last) const;
  std::optional<DeviceCounts> read_report() const;

  DeviceVolume::Impl& volume_;
  SurfaceOptions options_;
  TileSearch search_;
  LaunchShapes shapes_;
  std::uint32_t launches_ = 0, epoch_ = 0;
  DeviceBuffer<CaseTable> cases_;
  DeviceBuffer<TileItem> items_;
  DeviceBuffer<std::uint32_t> slot_of_tile_;
  DeviceBuffer<OrderState> order_;
  DeviceBuffer<std::byte> words_;  ///< Counters, then the sums of the search
  DeviceBuffer<RowTable> row_tables_;
  MappedHost<LaunchReport> report_;
  std::optional<SpanIndices> index_;       ///< of many tiles, where the search is through one
  std::optional<HostSearch> host_search_;  ///< of few tiles
  KernelGraph graph_;
  StandingLaunch standing_;
};

}  // namespace isobrick::gpu
