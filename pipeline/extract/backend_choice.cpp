#include "pipeline/extract/backend_choice.h"

#include <fmt/format.h>

#include <algorithm>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

/// What a thread takes for the surface in an active block, and what a device takes to set up
/// (measured: docs/experiments/2026-11-gpu.md). The GPU must save a good part of the latter.
constexpr double kSecondsOfBlock = 10e-6, kSecondsToSetUp = 0.5;

bool is_worth_it(const ExtractRequest& request, std::uint64_t active_blocks) {
  return static_cast<double>(active_blocks) * kSecondsOfBlock / request.threads >
         2 * kSecondsToSetUp;
}

/// Plans for as many of the first surfaces as the GPU has room for together; how many.
std::size_t plan_gpu_pass(PassRequests requests, const ExtractOptions& options,
                          std::uint64_t other_bytes, GpuSession& gpu, ExtractPlan& plan) {
  for (std::size_t count = requests.size();; --count) try {
      plan = plan_gpu_memory(requests.first(count), options, other_bytes, gpu);
      return count;
    } catch (const UsageError&) {
      if (count == 1) throw;
    }
}

}  // namespace

bool use_cuda(const ExtractRequest& request, const ExtractOptions& options,
              std::uint64_t active_blocks) {
  if (options.backend == Backend::cpu) return false;
  if (request.part) active_blocks = request.part->active_blocks;
  const bool must = options.backend == Backend::cuda;
  if (must && !built_with_cuda())
    throw Error("--backend cuda: this isobrick was built without CUDA; use --backend cpu");
  const bool wanted = must || is_worth_it(request, active_blocks);
  if (!wanted && options.device == 0) return false;
  const int devices = cuda_device_count();
  if (must && devices == 0)
    throw Error("--backend cuda: there is no CUDA device here; use --backend cpu");
  if (devices > 0) check_cuda_device(options.device, devices);
  return wanted && devices > 0;
}

void check_cuda_device(int device, int devices) {
  if (device < 0 || device >= devices)
    throw UsageError(fmt::format("--device {} does not exist: there {} {} CUDA device{}, from 0",
                                 device, devices == 1 ? "is" : "are", devices,
                                 devices == 1 ? "" : "s"));
}

bool can_be_resident(PassRequests requests) {
  return isovalues_of(requests).size() > 1 &&
         std::all_of(requests.begin(), requests.end(), [](const ExtractRequest& r) {
           return r.surface.indexing == Indexing::welded;
         });
}

ChosenBackend set_up_backend(PassRequests requests, const ExtractOptions& options,
                             std::uint64_t other_bytes, std::span<MeshSink* const> sinks,
                             const OpenGpu& open, const BeginDecoding& begin) {
  ChosenBackend chosen;
  try {
    chosen.gpu = open();
    if (chosen.gpu) {
      const std::size_t count =
          plan_gpu_pass(requests, options, other_bytes, *chosen.gpu, chosen.plan);
      chosen.decoded = begin(requests.first(count), chosen.plan, *chosen.gpu);
      for (std::size_t i = 0; i < count; ++i)
        chosen.surfaces.push_back(chosen.gpu->make_surface(requests[i], i, *sinks[i]));
      return chosen;
    }
  } catch (const Error& e) {
    if (options.backend == Backend::cuda) throw;
    chosen.gpu_refusal = e.what();
    chosen.surfaces.clear();
    chosen.decoded.reset();
    chosen.gpu.reset();
  }
  const std::size_t count = surfaces_of_pass(requests, options.memory, other_bytes);
  chosen.plan = plan_memory(requests.first(count), options.memory, other_bytes);
  const auto spaces = std::make_shared<TileWorkSpaces>();
  for (std::size_t i = 0; i < count; ++i) {
    auto surface = std::make_unique<CpuExtractor>(requests[i].level->lattice, requests[i].surface,
                                                  chosen.plan.limits, sinks[i], spaces);
    if (const auto& part = requests[i].part) surface->make_part(part->tiles, *part->places);
    chosen.surfaces.push_back(std::move(surface));
  }
  return chosen;
}

}  // namespace isobrick
