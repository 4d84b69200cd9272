#pragma once

#include "isobrick/gpu/device_volume.h"
#include "isobrick/gpu/stream.h"
#include "isobrick/gpu/tile_params.h"

namespace isobrick::gpu {

struct DeviceVolume::Impl {
  Lattice lattice;
  Stream stream;
  std::uint32_t tile_count = 0;
  DeviceBuffer<std::byte> pages;
  DeviceBuffer<std::byte> columns;           ///< of the pages: TileParams::columns
  DeviceBuffer<std::uint32_t> page_of_tile;  ///< [z, y, x]; empty where all tiles have pages
  DeviceBuffer<std::int32_t> tiles;          ///< x, y, z of all in Morton order
  DeviceBuffer<std::byte> ranges;            ///< of all in Morton order

  Impl(const Lattice& lattice, const BrickLookup& bricks, double fill_value);

  /// What the kernels need to find samples; page 0 is that of the fill value.
  TileParams params() const;

 private:
  void upload_pages(const BrickLookup& bricks, double fill_value);
  void list_tiles();
};

}  // namespace isobrick::gpu
