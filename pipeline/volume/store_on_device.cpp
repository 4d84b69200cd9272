#include "pipeline/volume/store_on_device.h"

#include <fmt/format.h>

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include <isobrick/device.h>
#include <isobrick/error.h>
#include "core/cancellable_progress.h"
#include "core/morton.h"
#include "gpu/memory/device_scope.h"
#include "pipeline/extract/backend_choice.h"
#include "pipeline/extract/device_loader.h"
#include "pipeline/program_memory.h"
#include "pipeline/workers.h"
#include "stream/tile_stream.h"

namespace isobrick::inline v0 {
namespace {

/// Every tile of a region, with the samples around it that normals take.
SurfaceTiles tiles_of_region(const Lattice& lattice, Box3 region) {
  const Int3 edge{kTileEdge, kTileEdge, kTileEdge}, one{1, 1, 1};
  const auto tile_of = [&](Int3 p) { return Int3{p.x / edge.x, p.y / edge.y, p.z / edge.z}; };
  const Box3 box{tile_of(region.lo), tile_of(region.hi - one) + one};
  SurfaceTiles tiles;
  for_each_morton(box.extent(), [&](Int3 t) { tiles.searched.push_back(box.lo + t); });
  std::sort(tiles.searched.begin(), tiles.searched.end(),
            [](Int3 a, Int3 b) { return morton_encode(a) < morton_encode(b); });
  tiles.loaded = gpu::tiles_to_load(lattice, tiles.searched, 1);
  return tiles;
}

/// Parts of a level that are searched at the same time, and what the ranges of one take.
constexpr int kSearches = 4;
constexpr std::uint64_t kSearchBytes = std::uint64_t{6} << 20;

/// The samples of each range chunk's cells in a region, in Morton order.
std::vector<Box3> chunks_of(const Lattice& lattice, Box3 region) {
  constexpr Index edge = StoreReader::kRangeChunk * kBlockEdge;
  const Int3 one{1, 1, 1};
  std::vector<Box3> chunks;
  for_each_morton(ceil_div(lattice.extent, {edge, edge, edge}), [&](Int3 c) {
    const Box3 cells = intersect({c * edge, (c + one) * edge}, {region.lo, region.hi - one});
    if (!cells.empty()) chunks.push_back({cells.lo, cells.hi + one});
  });
  return chunks;
}

class StoreLoad {
 public:
  StoreLoad(const StoreReader& store, const ExtractOptions& options, LoadedPart part)
      : store_(store),
        options_(options),
        part_(part),
        request_(checked(store, options)),
        loader_(store, options.level, request_, options.device) {}

  StoreOnDevice run(const DeviceTarget& target, Progress& progress) {
    const ExtractPlan plan = plan_host();
    return Workers(request_.threads).execute([&] {
      const gpu::DeviceScope scope(options_.device);
      const gpu::DeviceInfo device = gpu::open_device(options_.device);
      const SurfaceTiles tiles = find_tiles();
      check_room(tiles, device);
      auto volume = std::make_unique<gpu::DeviceVolume>(
          lattice(), request_.surface.fill_value, gpu::DeviceTiles{tiles.searched, tiles.loaded},
          &target);
      load(*volume, tiles.loaded, plan, progress);
      return StoreOnDevice{
          std::make_unique<gpu::CachedExtractor>(options_.device, request_.surface.transform,
                                                 std::move(volume), request_.surface.may_have_nan),
          request_.surface.roi, request_.surface.inside};
    });
  }

 private:
  static ExtractRequest checked(const StoreReader& store, const ExtractOptions& options) {
    if (options.backend == Backend::cpu)
      throw UsageError("surfaces on a device are made by the GPU");
    const int devices = cuda_device_count();
    if (devices == 0) throw Error("there is no CUDA device here");
    check_cuda_device(options.device, devices);
    return check_request(store, options, Indexing::welded);
  }

  const Lattice& lattice() const { return request_.level->lattice; }

  ExtractPlan plan_host() const {
    const std::uint64_t others = decode_extra(store_.info(), request_.threads) +
                                 store_.storage()->memory() + loader_.pinned_bytes() +
                                 kSearches * (kSearchBytes + request_.search_memory);
    const PassRequests requests{&request_, 1};
    if (const auto plan = plan_resident_memory(requests, options_.memory, others)) return *plan;
    throw UsageError(fmt::format(
        "a memory budget of {:.1f} MiB is too small to read samples to a device: {} MiB are needed",
        in_mib(options_.memory), mib_above(least_resident_memory(requests, others))));
  }

  SurfaceTiles find_tiles() const {
    if (part_ == LoadedPart::all) return tiles_of_region(lattice(), request_.surface.roi);
    const std::vector<Box3> chunks = chunks_of(lattice(), request_.surface.roi);
    std::vector<std::vector<Int3>> found(chunks.size());
    tbb::task_arena(std::min(kSearches, request_.threads)).execute([&] {
      tbb::parallel_for(std::size_t{0}, chunks.size(), [&](std::size_t i) {
        TileStream stream(store_, options_.level, request_.surface.isovalue, chunks[i],
                          request_.search);
        while (const std::optional<TileWork> work = stream.next()) found[i].push_back(work->tile);
      });
    });
    SurfaceTiles tiles;
    for (const std::vector<Int3>& some : found)
      tiles.searched.insert(tiles.searched.end(), some.begin(), some.end());
    tiles.active = tiles.searched.size();
    tiles.loaded = gpu::tiles_to_load(lattice(), tiles.searched, sample_reach(request_.surface));
    return tiles;
  }

  void check_room(const SurfaceTiles& tiles, const gpu::DeviceInfo& device) const {
    const std::uint64_t bytes =
        gpu::resident_sizes(lattice(), tiles.count(), false).volume_bytes + loader_.device_bytes();
    const std::string needed =
        fmt::format("reading these samples to the device takes {:.1f} MiB", in_mib(bytes));
    if (options_.gpu_memory > 0 && bytes > options_.gpu_memory)
      throw UsageError(fmt::format("a budget of {:.1f} MiB of device memory is too small: {}",
                                   in_mib(options_.gpu_memory), needed));
    if (bytes > device.free_bytes)
      throw gpu::OutOfDeviceMemory(
          fmt::format("{}, which has {:.1f} MiB free; choose a region or a coarser level", needed,
                      in_mib(device.free_bytes)));
  }

  void load(gpu::DeviceVolume& volume, std::span<const Int3> tiles, const ExtractPlan& plan,
            Progress& caller) {
    CancellableProgress progress(caller, options_.cancel);
    const std::uint64_t tile_bytes = kTileVolume * lattice().sample_bytes();
    progress.begin("reading", tiles.size() * tile_bytes);
    std::size_t before = 0;
    loader_.load(volume, tiles, plan.limits.tiles, [&](std::size_t done) {
      progress.advance((done - std::exchange(before, done)) * tile_bytes);
    });
    progress.end();
  }

  const StoreReader& store_;
  const ExtractOptions& options_;
  LoadedPart part_;
  ExtractRequest request_;
  DeviceLoader loader_;
};

}  // namespace

StoreOnDevice load_to_device(const StoreReader& store, const ExtractOptions& options,
                             const DeviceTarget& target, LoadedPart part, Progress& progress) {
  return StoreLoad(store, options, part).run(target, progress);
}

}  // namespace isobrick
