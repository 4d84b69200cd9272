#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <list>
#include <memory>
#include <span>
#include <unordered_map>
#include <vector>

#include "isobrick/bricks/store_reader.h"

namespace isobrick {

/// Decoded bricks of one level. Dropped are those that no later tile needs, and the least
/// recently needed ones when more than `capacity` would be held.
class BrickCache final : public BrickLookup {
 public:
  /// For tiles that look at `reach` samples around them.
  BrickCache(const StoreReader& store, int level, Index reach, std::size_t capacity);

  /// Makes these bricks (no more than the capacity, none twice) resident,
  /// reading and decoding in parallel in the caller's TBB arena. Their samples stay where
  /// they are until the next call.
  void require(std::span<const Int3> bricks);

  /// All tiles before Morton code `code` are done: what only they needed goes, and its memory,
  /// which the processor has at hand, is taken first for what comes next.
  void drop_before(std::uint64_t code);

  /// Hints that these bricks are required next: starts the disk for those that
  /// are not resident.
  void will_need(std::span<const Int3> bricks) const;

  const std::byte* find(Int3 brick) const override;

  std::size_t capacity() const { return capacity_; }
  /// Bricks read and decoded so far, and how many different ones.
  std::uint64_t reads() const { return reads_; }
  std::uint64_t bricks_read() const { return bricks_read_; }

 private:
  using Samples = std::byte*;
  struct Entry {
    std::uint64_t key = 0;
    Samples samples = nullptr;   ///< null: the brick is absent
    std::uint64_t last_use = 0;  ///< Morton code of a tile
  };
  using Order = std::list<Entry>;

  std::uint64_t key(Int3 brick) const;
  Samples take_buffer();
  Samples new_buffer();

  const StoreReader& store_;
  int level_;
  Index reach_;
  Lattice lattice_;
  std::size_t capacity_;
  std::size_t buffers_ = 0;  ///< allocated, in entries or spare
  Order order_;              ///< most recently needed first
  std::unordered_map<std::uint64_t, Order::iterator> entries_;
  std::vector<Samples> spare_;
  struct Free {
    void operator()(std::byte* slab) const { std::free(slab); }
  };
  std::vector<std::unique_ptr<std::byte, Free>> slabs_;  ///< memory of many bricks each
  std::size_t slab_buffers_ = 0;                         ///< not yet used in the last one
  /// Key and last use of those that went for want of room and may come back.
  std::unordered_map<std::uint64_t, std::uint64_t> cut_;
  std::uint64_t reads_ = 0, bricks_read_ = 0;
};

}  // namespace isobrick
