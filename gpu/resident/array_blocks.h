#pragma once

#include <cstdint>

#include <isobrick/device_array.h>
#include <isobrick/lattice.h>
#include "gpu/memory/device_buffer.h"
#include "gpu/resident/array_params.h"

namespace isobrick::inline v0::gpu {

/// The tiles of an array that surfaces have looked at so far, as tile blocks, so that device memory
/// is proportional to those and not to the array. Not thread-safe.
class ArrayBlocks {
 public:
  /// The array must stay as it is.
  ArrayBlocks(const DeviceArray& array, const Lattice& lattice, const Stream& stream);

  /// Begins to find the ranges of all tiles.
  void launch_ranges();
  /// Puts them into `ranges`, in the order of `order`, x, y, z of each tile. Waits; whether a
  /// sample is NaN.
  bool finish_ranges(const std::int32_t* order, void* ranges);

  /// Makes blocks, in the order of the stream, of all tiles that the active ones look at. Where
  /// there is no room for them no tile is active afterwards.
  void launch_load(const TileItem* items, const std::uint32_t* found, std::uint32_t* item_count,
                   int reach);
  /// After a launch that wanted more blocks than there is room for.
  bool lacks_room(std::uint32_t wanted) const { return wanted > room_; }
  /// Bytes of device memory that make_room() takes beyond what is held.
  std::uint64_t bytes_to_make_room(std::uint32_t wanted) const;
  /// Forgets all blocks, and takes more room where those of one launch did not fit.
  void make_room(std::uint32_t wanted);

  /// On the device: how many blocks were wanted.
  const std::uint32_t* wanted() const { return &counts_.data()->wanted; }
  /// Where the blocks are.
  void give(TileParams& p) const;
  std::uint64_t bytes() const;

 private:
  std::uint64_t bytes_of(std::uint32_t room) const;
  void take_room(std::uint32_t room);
  void forget();

  Lattice lattice_;
  Stream stream_;
  ArrayParams array_{};
  std::uint32_t room_ = 0;   ///< tiles
  std::uint32_t loads_ = 0;  ///< launches since no tile was a block
  DeviceBuffer<std::byte> tile_blocks_, columns_;
  DeviceBuffer<std::uint32_t> block_of_tile_, places_;
  DeviceBuffer<ArrayBlockCounts> counts_;
  ArrayRangeParams finding_{};  ///< until finish_ranges()
  DeviceBuffer<std::byte> part_ranges_;
  DeviceBuffer<std::uint32_t> found_nan_;
};

}  // namespace isobrick::gpu
