#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include <isobrick/device_volume.h>

namespace isobrick::inline v0::gpu {

class BrickPool;

/// Copies the tiles of a volume from bricks that lie in a pool on the device. Not thread-safe.
class TileLoader {
 public:
  /// Calls whose bricks are held at a time.
  static constexpr std::size_t kInFlight = 4;

  /// Page-locked host memory, and as much device memory, that one takes.
  static std::uint64_t table_bytes(const Lattice& lattice, std::size_t max_tiles);

  /// Both must outlive it. The device is the current one. A call takes at most `max_tiles`.
  TileLoader(DeviceVolume& volume, BrickPool& pool, std::size_t max_tiles);
  /// Waits for the device. The volume is complete when all of its tiles were loaded.
  ~TileLoader();

  /// In the caller's TBB arena. Waits for nothing but the copies of the call kInFlight before.
  /// `bricks` has the places on the device of those that the tiles lie in, which stay as they are
  /// until `held` is let go.
  void load(std::span<const Int3> tiles, const BrickLookup& bricks,
            std::shared_ptr<const void> held);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick::gpu
