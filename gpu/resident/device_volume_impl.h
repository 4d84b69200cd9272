#pragma once

#include <functional>
#include <optional>
#include <vector>

#include <isobrick/device_volume.h>
#include "gpu/memory/device_buffer.h"
#include "gpu/memory/pinned_buffer.h"
#include "gpu/resident/array_blocks.h"
#include "gpu/tile/tile_params.h"

namespace isobrick::inline v0::gpu {

struct DeviceVolume::Impl {
  Lattice lattice;
  double fill_value;
  bool has_nan = false;
  Stream stream;
  std::uint32_t tile_count = 0;               ///< that are searched
  DeviceBuffer<std::byte> tile_blocks;        ///< that of the fill value, then of the loaded tiles
  DeviceBuffer<std::byte> columns;            ///< of the tile blocks: TileParams::columns
  DeviceBuffer<std::uint32_t> block_of_tile;  ///< [z, y, x]; empty where block i + 1 is of tile i
  DeviceBuffer<std::int32_t> tiles;           ///< x, y, z of the searched, in their order
  DeviceBuffer<std::byte> ranges;             ///< of the searched, in their order
  std::optional<ArrayBlocks> array;  ///< where it is one of an array, instead of the blocks

  Impl(const Lattice& lattice, double fill_value, const DeviceTiles& tiles,
       std::size_t staging_bytes, Stream stream);
  explicit Impl(const DeviceArray& samples);
  ~Impl();

  void load(std::span<const Int3> tiles, const BrickLookup& bricks);
  /// The blocks of the next tiles, one behind the other, which the caller fills in the order of
  /// `stream`. Tiles for which has_samples(i) is false share the block of the fill value.
  std::byte* take_blocks(std::span<const Int3> tiles,
                         const std::function<bool(std::size_t)>& has_samples);
  /// After the blocks are filled, or are to be filled by what is in the stream: finds the ranges
  /// when they were the last, and waits.
  void complete_if_loaded();
  /// What the kernels need to find samples; block 0 is that of the fill value.
  TileParams params() const;
  std::size_t grid_tiles() const { return static_cast<std::size_t>(volume(lattice.tiles())); }

 private:
  /// Pinned memory for blocks on their way, and what it needs no longer.
  struct Staging {
    PinnedBuffer<std::byte> blocks;
    Event copied;
  };

  std::size_t block_bytes() const { return kTileBlockSamples * lattice.sample_bytes(); }
  std::size_t loaded_blocks() const { return tile_blocks.bytes() / block_bytes() - 1; }
  void list_tiles(std::span<const Int3> searched);
  void load_staged(std::span<const Int3> tiles, const BrickLookup& bricks);
  void complete();

  std::vector<std::uint32_t> table_;  ///< block_of_tile, until all are loaded
  std::size_t loaded_ = 0;            ///< tiles
  std::vector<Staging> staging_;      ///< two, until all are loaded
  std::size_t turn_ = 0;
};

}  // namespace isobrick::gpu
