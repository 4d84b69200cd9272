#include "isobrick/gpu/gpu_extractor.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>

#include "isobrick/core/error.h"
#include "isobrick/gpu/row_slots.h"
#include "isobrick/gpu/stream_collector.h"
#include "isobrick/gpu/stream_device.h"
#include "isobrick/gpu/supported.h"
#include "isobrick/surface/tile_gather.h"

namespace isobrick::gpu {
namespace {

SurfaceOptions checked(const Lattice& lattice, SurfaceOptions options) {
  check_supported(lattice.type, options);
  if (std::isnan(options.isovalue)) throw UsageError("the isovalue is not a number");
  options.roi = intersect(options.roi, lattice.box());
  if (options.roi.empty()) throw UsageError("the region of interest holds no sample");
  return options;
}

/// Makes the device the calling thread's.
int current(int device) {
  check(cudaSetDevice(device));
  return device;
}

Int3 tile_of(Int3 p) { return {p.x / kTileEdge, p.y / kTileEdge, p.z / kTileEdge}; }

}  // namespace

struct GpuExtractor::Impl {
  int cuda_device;
  Lattice lattice;
  SurfaceOptions options;
  Int3 first_tile;
  StreamDevice device;
  RowSlots slots;
  StreamStage gather;
  std::uint64_t launches = 0;
  StreamCollector collector;  // ends first: its thread uses the device

  Impl(int id, const Lattice& l, const SurfaceOptions& o, const StreamSizes& sizes, TakeChunk take)
      : cuda_device(current(id)),
        lattice(l),
        options(checked(l, o)),
        first_tile(tile_of(options.roi.lo)),
        device(l, options, sizes),
        slots(device.sizes().slots, l.tiles()),
        collector(id, device, welded(), options.normals, std::move(take)) {}

  bool welded() const { return options.indexing == Indexing::welded; }

  /// A tile's links: its own slot and those of the tiles before it.
  TileItem link(const TileWork& work, std::uint32_t index, TileLinks& links) {
    links.active_blocks = work.active_blocks;
    std::fill(std::begin(links.before), std::end(links.before), kNone);
    TileItem item{static_cast<std::int32_t>(work.tile.x), static_cast<std::int32_t>(work.tile.y),
                  static_cast<std::int32_t>(work.tile.z), index};
    if (!welded()) return item;
    for (int n = 1; n <= 6; ++n) {
      const Int3 step{n & 1, n >> 1 & 1, n >> 2};
      bool exists = true;
      for (int axis = 0; axis < 3; ++axis)
        exists = exists && (step[axis] == 0 || work.tile[axis] > first_tile[axis]);
      if (exists) links.before[n - 1] = slots.find(work.tile - step);
    }
    item.slot = slots.add(work.tile);
    return item;
  }

  void link_all(Lane& lane, std::span<const TileWork> tiles) {
    auto* items = reinterpret_cast<TileItem*>(lane.at(device.layout().items));
    auto* links = reinterpret_cast<TileLinks*>(lane.at(device.layout().links));
    for (std::uint32_t i = 0; i < tiles.size(); ++i) items[i] = link(tiles[i], i, links[i]);
    if (welded()) slots.end_launch(tiles.back().tile, lane.unused_slots);
  }

  /// Counts the time of each thread, for the cores may have other work as well.
  void gather_all(Lane& lane, std::span<const TileWork> tiles, const BrickLookup& bricks) {
    using Clock = std::chrono::steady_clock;
    const int reach = reach_of(options.normals);
    const Index edge = 33 + 2 * reach, origin = reach * (1 + edge + edge * edge);
    const std::size_t bytes = device.sizes().block_bytes;
    std::atomic<Clock::rep> ticks = 0;
    tbb::parallel_for(std::size_t{0}, tiles.size(), [&](std::size_t i) {
      const auto start = Clock::now();
      std::byte* block = lane.at(device.layout().blocks + i * bytes);
      gather_tile(lattice, bricks, options.fill_value, reach, tiles[i],
                  {block, origin, edge, edge * edge});
      ticks += (Clock::now() - start).count();
    });
    const std::chrono::duration<double> took = Clock::duration(ticks);
    gather.seconds += took.count() / tbb::this_task_arena::max_concurrency();
    gather.bytes += tiles.size() * bytes;
  }

  void launch(std::span<const TileWork> tiles, const BrickLookup& bricks) {
    Lane& lane = device.lane(launches);
    slots.recycle(lane.unused_slots);
    lane.count = static_cast<std::uint32_t>(tiles.size());
    *reinterpret_cast<LaunchHeader*>(lane.at(0)) = {.item_count = lane.count};
    std::fill_n(reinterpret_cast<OrderState*>(lane.at(device.layout().order)), tiles.size(),
                OrderState{0, 0});
    tbb::parallel_invoke([&] { gather_all(lane, tiles, bricks); }, [&] { link_all(lane, tiles); });
    device.submit(lane, launches++);
    collector.submitted(lane);
  }
};

GpuExtractor::GpuExtractor(int device, const Lattice& lattice, const SurfaceOptions& options,
                           const StreamSizes& sizes, TakeChunk take)
    : impl_(std::make_unique<Impl>(device, lattice, options, sizes, std::move(take))) {}
GpuExtractor::~GpuExtractor() = default;

void GpuExtractor::extract(std::span<const TileWork> tiles, const BrickLookup& bricks) {
  // The caller may come from any thread of an arena.
  current(impl_->cuda_device);
  while (!tiles.empty()) {
    impl_->collector.wait_for_lane();
    const std::size_t n = std::min<std::size_t>(tiles.size(), impl_->collector.good_tiles());
    impl_->launch(tiles.first(n), bricks);
    tiles = tiles.subspan(n);
  }
}

void GpuExtractor::finish() { impl_->collector.finish(); }

StreamReport GpuExtractor::report() const {
  StreamReport report = impl_->collector.report();
  const StreamSizes& sizes = impl_->device.sizes();
  report.gather = impl_->gather;
  report.tiles_of_launch = sizes.tiles;
  report.device_bytes = sizes.device_bytes;
  report.pinned_bytes = sizes.pinned_bytes;
  return report;
}

}  // namespace isobrick::gpu
