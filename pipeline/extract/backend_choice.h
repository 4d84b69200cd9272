#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "pipeline/extract/extract_plan.h"
#include "pipeline/extract/extract_tiles.h"
#include "pipeline/extract/gpu_backend.h"

namespace isobrick::inline v0 {

/// Whether the GPU is to make surfaces like this one, of which `active_blocks` are to be done: what
/// has kernels and promises to be faster there. For Backend::cuda, UsageError for what has no
/// kernels, and Error where there is no device or no CUDA backend. On a machine with devices,
/// UsageError for another one than those, whatever the backend but Backend::cpu.
bool use_cuda(const ExtractRequest& request, const ExtractOptions& options,
              std::uint64_t active_blocks);

/// Throws UsageError for a number of a device that is none of so many.
void check_cuda_device(int device, int devices);

/// Whether surfaces that a GPU makes may share samples kept on it (resident_pass.h): there are
/// several isovalues, all meshes are welded and no triangles are left out.
bool can_be_resident(PassRequests requests);

/// Who makes the surfaces of a pass, and with what memory. What comes later ends earlier.
struct ChosenBackend {
  ExtractPlan plan;
  std::unique_ptr<GpuSession> gpu;        ///< null: the CPU
  std::unique_ptr<DecodedTiles> decoded;  ///< for the GPU
  /// The first of the requested surfaces, as many as the budgets have room for together.
  std::vector<std::unique_ptr<SurfaceExtractor>> surfaces;
  std::string gpu_refusal;  ///< why the GPU that was to make them does not
};

/// What opens the GPU that is to make the surfaces; null where none is.
using OpenGpu = std::function<std::unique_ptr<GpuSession>()>;
/// What begins to decode for a GPU.
using BeginDecoding = std::function<std::unique_ptr<DecodedTiles>(
    PassRequests requests, const ExtractPlan& plan, GpuSession& gpu)>;

/// Divides the budgets among the first of `requests`, as many as fit, and sets their surfaces up;
/// `sinks` has one for each request. A GPU that was chosen by Backend::automatic
/// and cannot be opened, or has too little memory of its own or the host's, leaves its work to
/// the CPU; with Backend::cuda its error is thrown. UsageError, naming the least that works, for
/// a budget too small for one surface on the CPU. `other_bytes` as plan_memory(). While a GPU's
/// surfaces are set up their bricks are decoded already, which ends when that fails.
ChosenBackend set_up_backend(PassRequests requests, const ExtractOptions& options,
                             std::uint64_t other_bytes, std::span<MeshSink* const> sinks,
                             const OpenGpu& open, const BeginDecoding& begin);

}  // namespace isobrick
