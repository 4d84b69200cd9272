#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "pipeline/extract/extract_plan.h"
#include "stream/brick_memory.h"
#include "surface/surface_extractor.h"

// The CUDA backend as the pipeline sees it: gpu_backend.cpp where it is built, else
// no_gpu_backend.cpp.

namespace isobrick::inline v0 {

/// Whether this program has the CUDA backend.
bool built_with_cuda();
/// CUDA devices; 0 without the backend or a driver. The first call takes some tenths of
/// a second.
int cuda_device_count();

/// A CUDA device that is ready to work.
class GpuSession {
 public:
  virtual ~GpuSession() = default;

  /// Chooses buffers for these surfaces together, within `device_budget` (0: what is free less
  /// 10 %) and within `host_budget`, of which `other_host_bytes` are taken, for at most
  /// `most_bricks` bricks. The host memory that they take. Throws UsageError naming the least that
  /// works.
  virtual std::uint64_t plan(PassRequests requests, std::uint64_t device_budget,
                             std::uint64_t host_budget, std::uint64_t other_host_bytes,
                             std::uint64_t most_bricks) = 0;
  /// Tiles to hand to its surfaces at a time, as planned.
  virtual std::size_t preferred_batch() const = 0;
  /// Bricks that the device has room for, as planned; 0: they lie in host memory.
  virtual std::size_t pool_bricks() const = 0;
  /// Where the bricks that its surfaces are given lie.
  virtual BrickMemory& bricks() = 0;
  /// The surface of a request, by its number, as planned. Session and sink must outlive it.
  virtual std::unique_ptr<SurfaceExtractor> make_surface(const ExtractRequest& request,
                                                         std::size_t number, MeshSink& sink) = 0;
  /// Adds what it is and holds; while its surfaces are there.
  virtual void report(ExtractReport& report) const = 0;
};

/// Throws Error when the device cannot be made ready, or without the backend.
std::unique_ptr<GpuSession> open_gpu(int device);

}  // namespace isobrick
