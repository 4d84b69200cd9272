#include <isobrick/device_volume.h>

#include <tbb/parallel_for.h>

#include <algorithm>
#include <vector>

#include <isobrick/error.h>
#include "core/morton.h"
#include "gpu/memory/device_scalar.h"
#include "gpu/memory/nvtx_range.h"
#include "gpu/resident/device_volume_impl.h"
#include "gpu/search/search_kernel.h"
#include "gpu/tile/supported.h"
#include "gpu/tile/tile_block.h"

namespace isobrick::gpu {
namespace {

/// Bytes of samples that are gathered while the ones before are copied.
constexpr std::size_t kStagingBytes = std::size_t{32} << 20;

}  // namespace

DeviceVolume::Impl::Impl(const Lattice& l, const BrickLookup& bricks, double fill_value)
    : lattice(l) {
  if (!is_device_scalar(l.type)) throw UsageError(*why_unsupported(l.type, {}));
  if (volume(l.tiles()) >= kNone)
    throw UsageError("the volume has too many tiles to be resident on a device");
  tile_count = static_cast<std::uint32_t>(volume(l.tiles()));
  upload_tile_blocks(bricks, fill_value);
  list_tiles();
}

void DeviceVolume::Impl::upload_tile_blocks(const BrickLookup& bricks, double fill_value) {
  const NvtxRange range("upload tile blocks");
  const Int3 grid = lattice.tiles();
  const std::size_t tile_block_bytes = kTileBlockSamples * lattice.sample_bytes();
  tile_blocks = DeviceBuffer<std::byte>((std::size_t{tile_count} + 1) * tile_block_bytes, stream);
  const std::size_t batch = std::max<std::size_t>(1, kStagingBytes / tile_block_bytes);
  PinnedBuffer<std::byte> staging[2] = {PinnedBuffer<std::byte>(batch * tile_block_bytes),
                                        PinnedBuffer<std::byte>(batch * tile_block_bytes)};
  Event copied[2];
  fill_tile_block(lattice.type, fill_value, staging[0].data());
  check(cudaMemcpyAsync(tile_blocks.data(), staging[0].data(), tile_block_bytes,
                        cudaMemcpyHostToDevice, stream.get()));
  copied[0].record(stream);
  copied[1].record(stream);
  std::vector<std::uint32_t> table(tile_count);
  for (std::size_t first = 0, turn = 0; first < tile_count; first += batch, turn ^= 1) {
    const std::size_t count = std::min<std::size_t>(batch, tile_count - first);
    std::byte* to = staging[turn].data();
    copied[turn].wait();
    tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
      const auto n = static_cast<Index>(first + i);
      const Int3 tile{n % grid.x, n / grid.x % grid.y, n / (grid.x * grid.y)};
      const bool any =
          gather_tile_block(lattice, bricks, fill_value, tile, to + i * tile_block_bytes);
      table[first + i] = any ? static_cast<std::uint32_t>(first + i + 1) : kNone;
    });
    check(cudaMemcpyAsync(tile_blocks.data() + (first + 1) * tile_block_bytes, to,
                          count * tile_block_bytes, cudaMemcpyHostToDevice, stream.get()));
    copied[turn].record(stream);
  }
  if (std::find(table.begin(), table.end(), kNone) != table.end()) {
    block_of_tile = DeviceBuffer<std::uint32_t>(tile_count, stream);
    check(cudaMemcpyAsync(block_of_tile.data(), table.data(), block_of_tile.bytes(),
                          cudaMemcpyHostToDevice, stream.get()));
  }
  columns = DeviceBuffer<std::byte>(
      (std::size_t{tile_count} + 1) * kColumnSamples * lattice.sample_bytes(), stream);
  launch_first_columns(lattice.type, tile_blocks.data(), tile_count + 1, columns.data(),
                       stream.get());
  stream.wait();
}

void DeviceVolume::Impl::list_tiles() {
  const NvtxRange range("find tile ranges");
  std::vector<std::int32_t> order;
  order.reserve(3 * std::size_t{tile_count});
  for_each_morton(lattice.tiles(), [&](Int3 t) {
    for (int axis = 0; axis < 3; ++axis) order.push_back(static_cast<std::int32_t>(t[axis]));
  });
  tiles = DeviceBuffer<std::int32_t>(order.size(), stream);
  check(cudaMemcpyAsync(tiles.data(), order.data(), tiles.bytes(), cudaMemcpyHostToDevice,
                        stream.get()));
  ranges = DeviceBuffer<std::byte>(2 * lattice.sample_bytes() * tile_count, stream);
  launch_tile_ranges(lattice.type, params(), tiles.data(), tile_count, ranges.data(), stream.get());
  stream.wait();
}

TileParams DeviceVolume::Impl::params() const {
  TileParams p{};
  p.tile_blocks = tile_blocks.data();
  p.block_of_tile = block_of_tile.data();
  p.fill_tile_block = 0;
  p.columns = columns.data();
  for (int axis = 0; axis < 3; ++axis) {
    p.tiles[axis] = static_cast<std::int32_t>(lattice.tiles()[axis]);
    p.extent[axis] = static_cast<std::int32_t>(lattice.extent[axis]);
  }
  return p;
}

DeviceVolume::DeviceVolume(const Lattice& lattice, const BrickLookup& bricks, double fill_value)
    : impl_(std::make_unique<Impl>(lattice, bricks, fill_value)) {}
DeviceVolume::~DeviceVolume() = default;

const Lattice& DeviceVolume::lattice() const { return impl_->lattice; }

std::uint64_t DeviceVolume::bytes() const {
  return impl_->tile_blocks.bytes() + impl_->columns.bytes() + impl_->block_of_tile.bytes() +
         impl_->tiles.bytes() + impl_->ranges.bytes();
}

}  // namespace isobrick::gpu
