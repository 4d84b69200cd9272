#pragma once

#include <isobrick/device_volume.h>
#include "gpu/memory/device_buffer.h"
#include "gpu/memory/pinned_buffer.h"
#include "gpu/tile/tile_params.h"

namespace isobrick::gpu {

struct DeviceVolume::Impl {
  Lattice lattice;
  Stream stream;
  std::uint32_t tile_count = 0;
  DeviceBuffer<std::byte> tile_blocks;
  DeviceBuffer<std::byte> columns;            ///< of the tile_blocks: TileParams::columns
  DeviceBuffer<std::uint32_t> block_of_tile;  ///< [z, y, x]; empty where all tiles have tile_blocks
  DeviceBuffer<std::int32_t> tiles;           ///< x, y, z of all in Morton order
  DeviceBuffer<std::byte> ranges;             ///< of all in Morton order

  Impl(const Lattice& lattice, const BrickLookup& bricks, double fill_value);

  /// What the kernels need to find samples; block 0 is that of the fill value.
  TileParams params() const;

 private:
  void upload_tile_blocks(const BrickLookup& bricks, double fill_value);
  void list_tiles();
};

}  // namespace isobrick::gpu
