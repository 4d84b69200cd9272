#include "isobrick/pipeline/backend_choice.h"

#include <fmt/format.h>

#include "isobrick/core/error.h"
#include "isobrick/gpu/supported.h"

namespace isobrick {
namespace {

/// What a thread takes for the surface in an active block, and what a device takes to set up
/// (measured: docs/experiments/2026-11-gpu.md). The GPU must save a good part of the latter.
constexpr double kSecondsOfBlock = 10e-6, kSecondsToSetUp = 0.5;

bool is_worth_it(const ExtractRequest& request, std::uint64_t active_blocks) {
  return static_cast<double>(active_blocks) * kSecondsOfBlock / request.threads >
         2 * kSecondsToSetUp;
}

}  // namespace

bool use_cuda(const ExtractRequest& request, const ExtractOptions& options,
              std::uint64_t active_blocks) {
  if (options.backend == Backend::cpu) return false;
  const bool must = options.backend == Backend::cuda;
  const auto why = gpu::why_unsupported(request.level->lattice.type, request.surface);
  if (must && why) throw UsageError("--backend cuda: " + *why);
  if (must && !built_with_cuda())
    throw Error("--backend cuda: this isobrick was built without CUDA; use --backend cpu");
  const bool wanted = must || (!why && is_worth_it(request, active_blocks));
  if (!wanted && options.device == 0) return false;
  const int devices = cuda_device_count();
  if (must && devices == 0)
    throw Error("--backend cuda: there is no CUDA device here; use --backend cpu");
  if (devices > 0 && options.device >= devices)
    throw UsageError(fmt::format("--device {} does not exist: there {} {} CUDA device{}, from 0",
                                 options.device, devices == 1 ? "is" : "are", devices,
                                 devices == 1 ? "" : "s"));
  return wanted && devices > 0;
}

ChosenBackend set_up_backend(const ExtractRequest& request, const ExtractOptions& options,
                             std::uint64_t active_bricks, std::uint64_t other_bytes, MeshSink& sink,
                             const OpenGpu& open, const BeginDecoding& begin) {
  ChosenBackend chosen;
  try {
    chosen.gpu = open();
    if (chosen.gpu) {
      chosen.plan = plan_gpu_memory(request, options, active_bricks, other_bytes, *chosen.gpu);
      chosen.decoded = begin(chosen.plan, *chosen.gpu);
      chosen.surface = chosen.gpu->make_surface(request, sink);
      return chosen;
    }
  } catch (const Error& e) {
    if (options.backend == Backend::cuda) throw;
    chosen.gpu_refusal = e.what();
    chosen.decoded.reset();
    chosen.gpu.reset();
  }
  chosen.plan = plan_memory(request, options.memory, active_bricks, other_bytes);
  chosen.surface = make_cpu_surface(request, chosen.plan.limits, sink);
  return chosen;
}

}  // namespace isobrick
