#include "pipeline/extract/device_loader.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "core/stopwatch.h"
#include "gpu/resident/tile_loader.h"
#include "pipeline/extract/device_bricks.h"
#include "stream/batch_decoder.h"

namespace isobrick::inline v0 {
namespace {

/// The device begins with the first batch, so that none is large.
constexpr std::size_t kTilesOfBatch = 1024;
/// Those that wait for the device, one that is complete, and one that is decoded.
constexpr std::size_t kBatches = gpu::TileLoader::kInFlight + 2;

gpu::PoolSizes pool_sizes(const Lattice& lattice, const ExtractRequest& request) {
  const std::uint64_t in_flight = gpu::TileLoader::kInFlight * kTilesOfBatch * kTileVolume /
                                  static_cast<std::uint64_t>(volume(lattice.brick));
  const std::uint64_t wanted =
      std::min(static_cast<std::uint64_t>(volume(lattice.bricks())),
               gpu::preferred_pool_bricks(lattice, request.threads) + 2 * in_flight);
  const std::uint64_t least = kBatches * max_bricks_of_tile(lattice, 0);
  return {std::max(wanted, least), request.threads, request.packed};
}

}  // namespace

std::optional<SurfaceTiles> find_surface_tiles(TileStream& stream, const Lattice& lattice,
                                               Index reach, std::uint64_t max_tiles) {
  SurfaceTiles found;
  std::vector<std::uint64_t> active(stream.isovalues());
  while (const std::optional<TileWork> work = stream.next()) {
    if (found.searched.size() == max_tiles) return std::nullopt;
    found.searched.push_back(work->tile);
    for (std::size_t i = 0; i < active.size(); ++i) active[i] += stream.blocks_of_each()[i] != 0;
  }
  found.searched.shrink_to_fit();
  found.active = *std::max_element(active.begin(), active.end());
  found.loaded = gpu::tiles_to_load(lattice, found.searched, reach);
  return found;
}

DeviceLoader::DeviceLoader(const StoreReader& store, int level, const ExtractRequest& request,
                           int device)
    : store_(store),
      level_(level),
      lattice_(request.level->lattice),
      device_(device),
      pool_(pool_sizes(lattice_, request)) {}

std::uint64_t DeviceLoader::pinned_bytes() const {
  return pool_pinned_bytes(lattice_, pool_) + gpu::TileLoader::table_bytes(lattice_, kTilesOfBatch);
}

std::uint64_t DeviceLoader::device_bytes() const {
  return pool_device_bytes(lattice_, pool_) + gpu::TileLoader::table_bytes(lattice_, kTilesOfBatch);
}

void DeviceLoader::load(gpu::DeviceVolume& volume, std::span<const Int3> tiles,
                        std::size_t tiles_at_once, const std::function<void(std::size_t)>& done) {
  if (tiles.empty()) return;
  std::vector<TileWork> work;
  work.reserve(tiles.size());
  for (const Int3 tile : tiles) work.push_back({tile, 0xff});
  TileStream stream(std::move(work));
  const auto bricks = static_cast<std::size_t>(pool_.bricks);
  tiles_at_once = std::min({tiles_at_once, kTilesOfBatch, tiles.size()});
  BatchPlanner batches(stream, lattice_, kFirstCorners, true, tiles_at_once, bricks / kBatches);
  DeviceBricks memory(device_, lattice_, pool_);
  BatchDecoder decoder(store_, level_, batches, 0, bricks, pool_.threads, memory);
  gpu::TileLoader loader(volume, *memory.pool(), tiles_at_once);  // ends first: it holds batches
  wait_seconds_ = 0;
  std::size_t begun = 0;
  for (;;) {
    std::shared_ptr<const DecodedBatch> batch;
    {
      const Stopwatch watch(wait_seconds_);
      batch = decoder.next();
    }
    if (!batch) break;
    std::vector<Int3> some;
    some.reserve(batch->tiles().size());
    for (const TileWork& tile : batch->tiles()) some.push_back(tile.tile);
    loader.load(some, *batch, batch);
    done(begun += some.size());
  }
  bricks_read_ = decoder.bricks_read();
  reads_ = decoder.reads();
  upload_ = {memory.pool()->seconds(), memory.pool()->bytes()};
}

}  // namespace isobrick
