#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "gpu/memory/device_buffer.h"
#include "gpu/memory/mesh_arrays.h"
#include "gpu/memory/pinned_buffer.h"
#include "gpu/stream/brick_pool.h"
#include "gpu/stream/brick_table.h"
#include "gpu/stream/stream_layout.h"
#include "gpu/stream/stream_sizes.h"
#include "gpu/tile/tile_kernel.h"

namespace isobrick::inline v0::gpu {

/// The buffers of a launch in flight: what the host sends, and where its mesh goes on the device.
struct InFlightLaunch {
  std::byte* staging = nullptr;  ///< pinned
  std::byte* device = nullptr;   ///< the same, on the device
  std::byte* bricks = nullptr;   ///< those that are sent, likewise
  BrickUse use;
  std::shared_ptr<const void> samples;  ///< owns the bricks in host memory
  MeshArrays mesh;
  SurfaceTotals* totals = nullptr;  ///< pinned
  // Each that can be slept for wakes a thread of the driver's when it is over.
  Event extracted{cudaEventBlockingSync}, downloaded{cudaEventBlockingSync};
  Event upload_begin, uploaded, unpack_begin, unpacked, download_begin;
  std::uint32_t count = 0;                  ///< tiles
  bool only_counts = false;                 ///< its tiles have vertices that others use, no mesh
  std::vector<std::uint32_t> unused_slots;  ///< once this launch is not repeated any more

  std::byte* at(std::size_t offset) const { return staging + offset; }
};

/// The device's side of a streaming extraction: its memory, its streams, its launches.
class StreamDevice {
 public:
  /// Halves the launches until the device has room. Throws Error when one tile has none. With
  /// a pool that is where bricks lie, else they lie in host memory.
  StreamDevice(const Lattice& lattice, const SurfaceOptions& options, const StreamSizes& sizes,
               BrickPool* pool);
  ~StreamDevice();

  const StreamSizes& sizes() const { return sizes_; }
  const StagingLayout& layout() const { return layout_; }
  /// What is uploaded for a launch, and the samples of a tile.
  std::uint64_t sent_bytes(const InFlightLaunch& launch) const {
    return used_staging(launch) + launch.use.sent.size() * lattice_.brick_bytes();
  }
  std::uint64_t tile_block_bytes() const { return kTileBlockSamples * lattice_.sample_bytes(); }
  InFlightLaunch& in_flight(std::uint64_t number) {
    return *in_flight_[number % in_flight_.size()];
  }

  /// Uploads a launch with its bricks and extracts it, as launch `number`; waits for
  /// nothing.
  void submit(InFlightLaunch& launch, std::uint64_t number);
  /// Extracts tiles [first, first + count) of a launch that has been extracted once more, its
  /// vertices numbered from `number_start`. May be called beside submit().
  void submit_part(InFlightLaunch& launch, std::uint32_t first, std::uint32_t count,
                   std::uint64_t number_start);
  /// The running totals of a launch's tiles; waits for them.
  std::vector<OrderState> totals_of_tiles(InFlightLaunch& launch);
  /// Copies a launch's mesh to pinned memory; waits for nothing.
  void download(InFlightLaunch& launch, const MeshArrays& to, SurfaceTotals size);
  /// Waits until nothing is copied to the host any more, whatever went wrong.
  void end_downloads() noexcept { (void)cudaStreamSynchronize(download_.get()); }

 private:
  void launch_kernels(InFlightLaunch& launch, std::uint32_t first, std::uint32_t count,
                      const unsigned long long* number_start, unsigned long long* number_end,
                      bool tables_known);
  bool allocate(const StreamSizes& sizes);
  void send(InFlightLaunch& launch);
  std::size_t used_staging(const InFlightLaunch& launch) const {
    return layout_.bricks + launch.count * sizes_.tile_bricks * sizeof(std::uint64_t);
  }

  Lattice lattice_;
  SurfaceOptions options_;
  BrickPool* pool_;
  StreamSizes sizes_;
  StagingLayout layout_{0, 0, false};
  // Streams end before the memory that they work on.
  PinnedBuffer<std::byte> staging_;     ///< of all launches
  PinnedBuffer<SurfaceTotals> totals_;  ///< likewise
  DeviceBuffer<std::byte> memory_;
  std::vector<std::unique_ptr<InFlightLaunch>> in_flight_;
  Stream upload_, kernel_, download_;
  std::mutex launching_;
  TileParams params_{};
  std::byte* tile_blocks_ = nullptr;
  CaseTable* cases_ = nullptr;
  static constexpr std::uint64_t kEnds = 4;
  unsigned long long* number_ends_ = nullptr;  ///< of the last launches, in turn; then a zero
  std::uint32_t epoch_ = 0;
  LaunchShapes shapes_;
};

}  // namespace isobrick::gpu
