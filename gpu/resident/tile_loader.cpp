#include "gpu/resident/tile_loader.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include "gpu/memory/arena.h"
#include "gpu/memory/device_buffer.h"
#include "gpu/memory/nvtx_range.h"
#include "gpu/memory/pinned_buffer.h"
#include "gpu/resident/device_volume_impl.h"
#include "gpu/resident/gather_kernel.h"
#include "gpu/stream/brick_pool.h"
#include "gpu/stream/brick_table.h"

namespace isobrick::inline v0::gpu {
namespace {

constexpr std::size_t kTilesOfTask = 64;

/// Where the parts of a call's tables begin, in bytes.
struct TablesLayout {
  std::size_t boxes, tiles, bricks, end;

  TablesLayout(std::size_t count, std::size_t tile_bricks)
      : boxes(0),
        tiles(Arena::aligned(count * sizeof(BrickBox))),
        bricks(tiles + Arena::aligned(count * 3 * sizeof(std::int32_t))),
        end(bricks + Arena::aligned(count * tile_bricks * sizeof(std::uint64_t))) {}
};

/// Where a call finds its bricks, on the host and on the device.
struct Tables {
  std::byte* here = nullptr;
  std::byte* there = nullptr;
  Event copied{cudaEventDisableTiming};
  std::shared_ptr<const void> held;
};

/// Writes the tables of a call where they are sent from.
class TablesWriter {
 public:
  TablesWriter(const Lattice& lattice, std::span<const Int3> tiles, std::byte* here)
      : lattice_(lattice),
        tiles_(tiles),
        of_tile_(max_bricks_of_tile(lattice, kFirstCorners)),
        layout_(tiles.size(), of_tile_),
        here_(here),
        table_{{reinterpret_cast<BrickBox*>(here + layout_.boxes), tiles.size()},
               {reinterpret_cast<std::uint64_t*>(here + layout_.bricks), tiles.size() * of_tile_}} {
  }

  void write(const BrickLookup& bricks) {
    auto* place = reinterpret_cast<std::int32_t*>(here_ + layout_.tiles);
    for (const Int3 tile : tiles_)
      for (int axis = 0; axis < 3; ++axis) *place++ = static_cast<std::int32_t>(tile[axis]);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, tiles_.size(), kTilesOfTask),
                      [&](const auto& some) {
                        locate_bricks(lattice_, tiles_.subspan(some.begin(), some.size()), bricks,
                                      {table_.boxes.subspan(some.begin()),
                                       table_.addresses.subspan(some.begin() * of_tile_)});
                      });
  }

  /// Whether any of a tile's bricks is there; once they are written.
  bool has_samples(std::size_t tile) const {
    const std::int32_t* count = table_.boxes[tile].count;
    const auto addresses = table_.addresses.subspan(
        tile * of_tile_, static_cast<std::size_t>(count[0] * count[1] * count[2]));
    return std::any_of(addresses.begin(), addresses.end(),
                       [](std::uint64_t address) { return address != 0; });
  }

  /// For the kernel, which finds them there.
  GatherParams params(const std::byte* there, double fill_value) const {
    GatherParams p{};
    p.tiles = reinterpret_cast<const std::int32_t*>(there + layout_.tiles);
    p.boxes = reinterpret_cast<const BrickBox*>(there + layout_.boxes);
    p.bricks = reinterpret_cast<const std::uint64_t*>(there + layout_.bricks);
    p.count = static_cast<std::uint32_t>(tiles_.size());
    p.tile_bricks = static_cast<std::uint32_t>(of_tile_);
    for (int axis = 0; axis < 3; ++axis) {
      p.brick[axis] = static_cast<std::int32_t>(lattice_.brick[axis]);
      p.extent[axis] = static_cast<std::int32_t>(lattice_.extent[axis]);
    }
    p.fill_value = fill_value;
    return p;
  }

  static std::size_t bytes(const Lattice& lattice, std::size_t tiles) {
    return TablesLayout(tiles, max_bricks_of_tile(lattice, kFirstCorners)).end;
  }

 private:
  const Lattice& lattice_;
  std::span<const Int3> tiles_;
  std::size_t of_tile_;
  TablesLayout layout_;
  std::byte* here_;
  BrickTable table_;
};

}  // namespace

struct TileLoader::Impl {
  DeviceVolume::Impl& volume;
  BrickPool& pool;
  std::size_t max_tiles;
  PinnedBuffer<std::byte> here;
  DeviceBuffer<std::byte> there;
  std::array<Tables, kInFlight> tables;  ///< parts of those
  std::size_t turn = 0;

  Impl(DeviceVolume::Impl& v, BrickPool& p, std::size_t most)
      : volume(v),
        pool(p),
        max_tiles(most),
        here(table_bytes(v.lattice, most)),
        there(here.size(), v.stream) {
    for (std::size_t i = 0; i < kInFlight; ++i) {
      tables[i].here = here.data() + i * (here.size() / kInFlight);
      tables[i].there = there.data() + i * (here.size() / kInFlight);
      tables[i].copied.record(volume.stream);
    }
  }
  ~Impl() { (void)cudaStreamSynchronize(volume.stream.get()); }

  void load(std::span<const Int3> tiles, const BrickLookup& bricks,
            std::shared_ptr<const void> held) {
    const NvtxRange range("gather tiles");
    if (tiles.size() > max_tiles) throw UsageError("more tiles are loaded at once than was said");
    const std::size_t bytes = TablesWriter::bytes(volume.lattice, tiles.size());
    Tables& now = tables[turn++ % kInFlight];
    now.copied.wait();
    now.held = std::move(held);
    TablesWriter writer(volume.lattice, tiles, now.here);
    writer.write(bricks);
    GatherParams params = writer.params(now.there, volume.fill_value);
    params.tile_blocks =
        volume.take_blocks(tiles, [&](std::size_t i) { return writer.has_samples(i); });
    check(cudaMemcpyAsync(now.there, now.here, bytes, cudaMemcpyHostToDevice, volume.stream.get()));
    pool.wait_on(volume.stream);
    launch_gather(volume.lattice.type, params, volume.stream.get());
    now.copied.record(volume.stream);
    volume.complete_if_loaded();
  }
};

std::uint64_t TileLoader::table_bytes(const Lattice& lattice, std::size_t max_tiles) {
  return kInFlight * TablesWriter::bytes(lattice, max_tiles);
}

TileLoader::TileLoader(DeviceVolume& volume, BrickPool& pool, std::size_t max_tiles)
    : impl_(std::make_unique<Impl>(volume.impl(), pool, max_tiles)) {}
TileLoader::~TileLoader() = default;

void TileLoader::load(std::span<const Int3> tiles, const BrickLookup& bricks,
                      std::shared_ptr<const void> held) {
  if (!tiles.empty()) impl_->load(tiles, bricks, std::move(held));
}

}  // namespace isobrick::gpu
