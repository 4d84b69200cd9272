#include <algorithm>

#include <fmt/format.h>
#include <tbb/info.h>

#include <isobrick/error.h>
#include "pipeline/extract/gpu_backend.h"
#include "ranks/thread_ranks.h"
#include "tools/extract_part.h"

namespace isobrick::tools {

void choose_device(const Ranks& job, ExtractArguments& arguments) {
  std::vector<int>& devices = arguments.devices;
  if (devices.empty() && arguments.backend == Backend::cuda)
    for (int i = 0; i < cuda_device_count(); ++i) devices.push_back(i);
  if (devices.empty()) return;
  devices = {devices[static_cast<std::size_t>(job.node_rank()) % devices.size()]};
}

CommandOutput make_on_devices(const ExtractArguments& arguments,
                              const std::vector<ExtractedSurface>& surfaces,
                              const StoreReader& store, Console& console) {
  const auto count = static_cast<int>(arguments.devices.size());
  const int threads = arguments.threads > 0 ? arguments.threads : tbb::info::default_concurrency();
  CommandOutput output;
  run_on_threads(count, [&](Ranks& ranks) {
    const int rank = ranks.rank();
    const auto share = [&](ExtractOptions& options) {
      options.device = arguments.devices[static_cast<std::size_t>(rank)];
      options.backend = Backend::cuda;
      options.memory /= static_cast<unsigned>(count);
      options.threads = std::max(1, threads / count);
    };
    ExtractArguments own = arguments;
    own.memory /= static_cast<unsigned>(count);
    own.threads = std::max(1, threads / count);
    std::vector<ExtractedSurface> of_rank = surfaces;
    for (ExtractedSurface& surface : of_rank) share(surface.options);
    Console silent({.quiet = true});
    silent.mute();
    CommandOutput made = make_by_pieces(own, of_rank, store, &ranks, rank == 0 ? console : silent);
    if (rank == 0) output = std::move(made);
  });
  return output;
}

}  // namespace isobrick::tools
