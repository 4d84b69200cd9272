#include "gpu/stream/gpu_extractor.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include "gpu/stream/brick_table.h"
#include "gpu/stream/row_slots.h"
#include "gpu/stream/stream_collector.h"
#include "gpu/stream/stream_device.h"
#include "gpu/tile/on_samples.h"

namespace isobrick::inline v0::gpu {
namespace {

SurfaceOptions checked(const Lattice& lattice, SurfaceOptions options) {
  options = options_that_matter(lattice.type, options);
  if (std::isnan(options.isovalue)) throw UsageError("the isovalue is not a number");
  options.roi = intersect(options.roi, lattice.box());
  if (options.roi.empty()) throw UsageError("the region of interest holds no sample");
  return options;
}

std::size_t ceil_div(std::size_t a, std::size_t b) { return (a + b - 1) / b; }

Int3 tile_of(Int3 p) { return {p.x / kTileEdge, p.y / kTileEdge, p.z / kTileEdge}; }

}  // namespace

struct GpuExtractor::Impl {
  int cuda_device;
  Lattice lattice;
  SurfaceOptions options;
  Int3 first_tile;
  std::shared_ptr<BrickPool> pool;
  StreamDevice device;
  RowSlots slots;
  std::uint64_t launches = 0;
  std::vector<TileWork> whole;
  std::optional<TileRange> part;
  StreamCollector collector;  // ends first: its thread uses the device

  Impl(int id, const Lattice& l, const SurfaceOptions& o, const StreamSizes& sizes, MeshSink& sink,
       std::shared_ptr<BrickPool> brick_pool)
      : cuda_device(make_current(id)),
        lattice(l),
        options(checked(l, o)),
        first_tile(tile_of(options.roi.lo)),
        pool(std::move(brick_pool)),
        device(l, options, sizes, pool.get()),
        slots(device.sizes().slots, l.tiles()),
        collector(id, device, welded(), options.normals, sink) {}

  /// Where there may be NaN all of an active tile is looked at, because ranges leave NaN out.
  std::span<const TileWork> all_to_look_at(std::span<const TileWork> tiles) {
    if (!options.may_have_nan) return tiles;
    whole.assign(tiles.begin(), tiles.end());
    for (TileWork& tile : whole) tile.active_blocks = 0xff;
    return whole;
  }

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

  void link_all(InFlightLaunch& launch, std::span<const TileWork> tiles) {
    auto* items = reinterpret_cast<TileItem*>(launch.at(device.layout().items));
    auto* links = reinterpret_cast<TileLinks*>(launch.at(device.layout().links));
    auto* neighbours = reinterpret_cast<TileNeighbours*>(launch.at(device.layout().neighbours));
    for (std::uint32_t i = 0; i < tiles.size(); ++i) {
      if (has_samples(options)) slots.find_around(tiles[i].tile, neighbours[i]);
      items[i] = link(tiles[i], i, links[i]);
    }
    if (welded()) slots.end_launch(tiles.back().tile, launch.unused_slots);
  }

  /// Where the launch finds its bricks.
  BrickUse find_bricks(InFlightLaunch& launch, std::span<const TileWork> tiles,
                       const BrickLookup& bricks) {
    const StreamSizes& sizes = device.sizes();
    const BrickTable table{
        {reinterpret_cast<BrickBox*>(launch.at(device.layout().boxes)), sizes.tiles},
        {reinterpret_cast<std::uint64_t*>(launch.at(device.layout().bricks)),
         std::size_t{sizes.tiles} * sizes.tile_bricks}};
    return use_bricks(lattice, sample_reach(options), tiles, bricks, sizes.sent_bricks,
                      launch.bricks, table);
  }

  /// Of tiles that come before the part, those at the beginning; else all.
  std::size_t alike_from_first(std::span<const TileWork> tiles) const {
    if (!part || part->contains(tiles.front().tile)) return tiles.size();
    const auto own = std::find_if(tiles.begin(), tiles.end(),
                                  [&](const TileWork& work) { return part->contains(work.tile); });
    return static_cast<std::size_t>(own - tiles.begin());
  }

  void submit(std::span<const TileWork> tiles, const BrickLookup& bricks,
              std::shared_ptr<const void> samples) {
    InFlightLaunch& launch = device.in_flight(launches);
    slots.recycle(launch.unused_slots);
    launch.count = static_cast<std::uint32_t>(tiles.size());
    launch.only_counts = part && !part->contains(tiles.front().tile);
    launch.samples = std::move(samples);
    *reinterpret_cast<LaunchHeader*>(launch.at(0)) = {.item_count = launch.count};
    std::fill_n(reinterpret_cast<OrderState*>(launch.at(device.layout().order)), tiles.size(),
                OrderState{0, 0});
    launch.use = find_bricks(launch, tiles, bricks);
    link_all(launch, tiles);
    device.submit(launch, launches++);
    collector.submitted(launch);
  }
};

GpuExtractor::GpuExtractor(int device, const Lattice& lattice, const SurfaceOptions& options,
                           const StreamSizes& sizes, MeshSink& sink,
                           const std::shared_ptr<BrickPool>& pool)
    : impl_(std::make_unique<Impl>(device, lattice, options, sizes, sink, pool)) {}
GpuExtractor::~GpuExtractor() = default;

void GpuExtractor::make_part(const TileRange& part, TilePlaces& places) {
  impl_->part = part;
  impl_->collector.tell_places(places);
}

void GpuExtractor::extract(std::span<const TileWork> tiles, const BrickLookup& bricks,
                           const std::shared_ptr<const void>& samples) {
  // Calls may come from any thread.
  make_current(impl_->cuda_device);
  tiles = impl_->all_to_look_at(tiles);
  while (!tiles.empty()) {
    impl_->collector.wait_for_free_launch();
    const std::size_t alike = impl_->alike_from_first(tiles);
    const std::size_t n = ceil_div(alike, ceil_div(alike, impl_->collector.preferred_tiles()));
    impl_->submit(tiles.first(n), bricks, samples);
    tiles = tiles.subspan(n);
  }
}

void GpuExtractor::finish() { impl_->collector.finish(); }

SurfaceReport GpuExtractor::report() const {
  SurfaceReport report = impl_->collector.report();
  if (impl_->pool) {
    report.upload.seconds += impl_->pool->seconds();
    report.upload.bytes += impl_->pool->bytes();
  }
  const StreamSizes& sizes = impl_->device.sizes();
  report.device_bytes = sizes.device_bytes;
  report.pinned_bytes = sizes.pinned_bytes;
  return report;
}

}  // namespace isobrick::gpu
