#pragma once

#include <vector>

#include "isobrick/core/range.h"
#include "isobrick/gpu/device_volume.h"
#include "isobrick/gpu/stream.h"
#include "isobrick/gpu/tile_params.h"

namespace isobrick::gpu {

class ResidentLauncher;

struct DeviceVolume::Impl {
  Lattice lattice;
  Stream stream;
  std::uint32_t tile_count = 0;
  DeviceBuffer<std::byte> pages;
  DeviceBuffer<std::byte> columns;            ///< of the pages: TileParams::columns
  DeviceBuffer<std::uint32_t> page_of_tile;   ///< [z, y, x]; empty where all tiles have pages
  DeviceBuffer<std::int32_t> tiles;           ///< x, y, z of all in Morton order
  DeviceBuffer<std::uint32_t> order_of_tile;  ///< [z, y, x]: its place in that order
  DeviceBuffer<std::byte> ranges;             ///< of all in Morton order

  /// Few tiles and their ranges are also kept here, for the host to search: in Morton order.
  std::vector<Int3> tiles_here;
  std::vector<ValueRange<double>> ranges_here;

  /// Whose launch may stand by on the stream: others let it go before they launch.
  ResidentLauncher* standing = nullptr;

  Impl(const Lattice& lattice, const BrickLookup& bricks, double fill_value);

  /// What the kernels need to find samples; page 0 is that of the fill value.
  TileParams params() const;

 private:
  void upload_pages(const BrickLookup& bricks, double fill_value);
  void list_tiles();
  void keep_ranges_here();
};

}  // namespace isobrick::gpu
