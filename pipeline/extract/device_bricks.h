#pragma once

#include <cstddef>
#include <memory>
#include <utility>

#include "gpu/stream/brick_pool.h"
#include "gpu/stream/stream_sizes.h"
#include "stream/brick_memory.h"

namespace isobrick::inline v0 {

/// Bricks in a pool on a device, which decodes those that come packed.
class DeviceBricks final : public BrickMemory {
 public:
  /// Throws OutOfDeviceMemory.
  DeviceBricks(int device, const Lattice& lattice, const gpu::PoolSizes& sizes)
      : pool_(std::make_shared<gpu::BrickPool>(device, lattice, sizes.bricks, sizes.threads,
                                               sizes.packed)),
        ahead_(gpu::bricks_ahead(lattice, sizes)),
        packed_bytes_(sizes.packed ? gpu::BrickPool::buffer_bytes(lattice, true) : 0) {}

  const std::shared_ptr<gpu::BrickPool>& pool() const { return pool_; }

  std::shared_ptr<std::byte> room(std::size_t bytes) override {
    return {pool_, pool_->take(bytes)};
  }
  std::byte* begin(int thread, std::byte*) override { return pool_->begin(thread); }
  void end(int thread, std::byte* place) override { pool_->end(thread, place); }
  bool takes_packed() const override { return packed_bytes_ > 0; }
  std::span<std::byte> begin_packed(int thread) override {
    return {pool_->begin(thread), packed_bytes_};
  }
  void end_packed(int thread, std::byte* place, const PackedLoad& brick) override {
    pool_->end_packed(thread, place, brick.bytes, brick.brick, brick.range);
  }
  std::optional<Int3> find_damaged(bool all) override { return pool_->find_damaged(all); }
  std::size_t bricks_ahead() const override { return ahead_; }

 private:
  std::shared_ptr<gpu::BrickPool> pool_;
  std::size_t ahead_;
  std::size_t packed_bytes_;  ///< the most that a packed brick takes; 0: bricks come decoded
};

}  // namespace isobrick
