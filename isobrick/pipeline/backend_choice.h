#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "isobrick/pipeline/extract_plan.h"
#include "isobrick/pipeline/extract_tiles.h"
#include "isobrick/pipeline/gpu_backend.h"
#include "isobrick/pipeline/surface_extractor.h"

namespace isobrick {

/// Whether the GPU is to make this surface, of which `active_blocks` are to be done: what has
/// kernels and promises to be faster there. For Backend::cuda, UsageError for what has no
/// kernels, and Error where there is no device or no CUDA backend. On a machine with devices,
/// UsageError for another one than those, whatever the backend but Backend::cpu.
bool use_cuda(const ExtractRequest& request, const ExtractOptions& options,
              std::uint64_t active_blocks);

/// Who makes a surface, and with what memory. What comes later ends earlier.
struct ChosenBackend {
  ExtractPlan plan;
  std::unique_ptr<GpuSession> gpu;        ///< null: the CPU
  std::unique_ptr<DecodedTiles> decoded;  ///< for the GPU
  std::unique_ptr<SurfaceExtractor> surface;
  std::string gpu_refusal;  ///< why the GPU that was to make it does not
};

/// What opens the GPU that is to make a surface; null where none is.
using OpenGpu = std::function<std::unique_ptr<GpuSession>()>;
/// What begins to decode for a GPU.
using BeginDecoding =
    std::function<std::unique_ptr<DecodedTiles>(const ExtractPlan& plan, GpuSession& gpu)>;

/// Divides the budgets and sets the surface up. A GPU that was chosen by Backend::automatic
/// and cannot be opened, or has too little memory of its own or the host's, leaves its work to
/// the CPU; with Backend::cuda its error is thrown. UsageError, naming the least that works, for
/// a budget too small for the CPU. `other_bytes` as plan_memory(). While a GPU's surface is set up
/// its bricks are decoded already, which ends when that fails.
ChosenBackend set_up_backend(const ExtractRequest& request, const ExtractOptions& options,
                             std::uint64_t active_bricks, std::uint64_t other_bytes, MeshSink& sink,
                             const OpenGpu& open, const BeginDecoding& begin);

}  // namespace isobrick
