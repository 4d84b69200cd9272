#pragma once

#include <condition_variable>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "gpu/memory/pinned_region.h"
#include "gpu/stream/stream_device.h"
#include "surface/chunk_writer.h"
#include "surface/tile_places.h"

namespace isobrick::inline v0::gpu {

/// Follows the launches of a streaming extraction on a thread of its own. Waits for their kernels
/// and repeats in parts what did not fit its output. Downloads the meshes and hands them to the
/// sink in order.
class StreamCollector {
 public:
  StreamCollector(int cuda_device, StreamDevice& device, bool welded, bool normals, MeshSink& sink);
  ~StreamCollector();

  /// Waits until the buffers of the next launch are free. Rethrows what went wrong.
  void wait_for_free_launch();
  /// From now on `places` hears where the meshes of tiles lie; before the first launch.
  void tell_places(TilePlaces& places) { places_ = &places; }
  /// A launch was submitted.
  void submitted(InFlightLaunch& launch);
  /// How many tiles a launch may have, going by the meshes so far.
  std::uint32_t preferred_tiles() const;
  /// Waits until the sink has taken every mesh. Rethrows what went wrong.
  void finish();
  /// All but what the host's side knows; after finish().
  SurfaceReport report() const;

 private:
  /// A mesh on its way to the host.
  struct Pending {
    InFlightLaunch* launch = nullptr;
    std::size_t output = 0;
    SurfaceTotals size{};
    std::uint64_t first_vertex = 0;
  };

  void run();
  void follow();
  InFlightLaunch* next_submitted(bool wait);
  std::optional<Pending> collect(InFlightLaunch& launch);
  void note_places(InFlightLaunch& launch, std::uint64_t left_out);
  void repeat_in_parts(InFlightLaunch& launch);
  Pending start_download(InFlightLaunch& launch, SurfaceTotals size);
  void deliver(const Pending& pending);
  void check_numbers(std::uint64_t more) const;
  std::size_t take_output();
  MeshArrays output(std::size_t index);
  void give_output(std::size_t output);
  void release_launch(std::uint32_t tiles, SurfaceTotals size);

  int cuda_device_;
  StreamDevice& device_;
  bool welded_, normals_;
  PinnedRegion outputs_;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<InFlightLaunch*> in_flight_;  ///< submitted, not collected
  int busy_ = 0;                           ///< submitted, not free
  bool closed_ = false, stop_ = false;
  std::exception_ptr error_;
  std::uint32_t preferred_tiles_;
  std::vector<std::size_t> free_outputs_;

  // Ends before all above: chunks that it still has go back to the outputs.
  ChunkWriter writer_;

  // Used by the thread only, until it ends.
  std::optional<Pending> pending_;
  SurfaceReport report_;
  TilePlaces* places_ = nullptr;
  std::uint64_t vertices_before_ = 0;  ///< in `report_`, of launches that only count

  std::thread thread_;
};

}  // namespace isobrick::gpu
