#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <set>
#include <unordered_map>
#include <utility>
#include <vector>

#include <isobrick/lattice.h>
#include "stream/distinct_bricks.h"

namespace isobrick::inline v0 {

/// Comes after the code of every tile.
inline constexpr std::uint64_t kNever = ~std::uint64_t{0};

/// Morton code of the first tile at or after `code` whose samples, `reach` layers around
/// its 33³ included, lie in `brick`; kNever when there is none.
std::uint64_t next_use(const Lattice& lattice, Index reach, Int3 brick, std::uint64_t code);

/// Morton code of the last tile whose samples, as above, lie in `brick`.
std::uint64_t last_use(const Lattice& lattice, Index reach, Int3 brick);

/// Which decoded brick lies in which slot of memory. As tiles come in Morton order, it is
/// known when a brick will be needed next. Where room is short, the brick that is needed last is
/// dropped. Bookkeeping only; not thread-safe.
class BrickSlots {
 public:
  BrickSlots(const Lattice& lattice, Index reach)
      : lattice_(lattice), reach_(reach), bricks_read_(lattice) {}

  Int3 grid() const { return lattice_.bricks(); }

  /// Takes over memory for `count` bricks, one after the other.
  void add_slots(std::shared_ptr<std::byte> memory, std::size_t count);
  /// The bricks of all tiles before `code` have been held. Drops bricks that nobody holds and no
  /// later tile needs.
  void advance(std::uint64_t code);

  /// Keeps a brick until release(). False when it is not here.
  bool hold(Int3 brick);
  /// Puts a brick that is not here into a slot, and holds it. Null when all slots are held.
  std::byte* place(Int3 brick);
  /// The store has no such brick, so its slot is free again.
  void set_absent(Int3 brick);
  /// The brick was read and decoded.
  void count_read(Int3 brick);
  void release(Int3 brick) noexcept;

  bool contains(Int3 brick) const { return entries_.count(key(brick)) > 0; }
  /// The samples of a brick that is held; null when it is absent.
  const std::byte* find(Int3 brick) const { return entries_.at(key(brick)).slot; }
  /// Slots that there is memory for.
  std::size_t slots() const { return slots_; }
  /// Slots without a brick.
  std::size_t free_slots() const { return free_.size(); }
  /// Bricks decoded so far, and how many different ones.
  std::uint64_t reads() const { return reads_; }
  std::uint64_t bricks_read() const { return bricks_read_.count(); }
  /// Memory that grows with the lattice.
  static std::uint64_t bytes(const Lattice& lattice) { return DistinctBricks::bytes(lattice); }

 private:
  using IdleSet = std::set<std::pair<std::uint64_t, std::uint64_t>>;
  struct Entry {
    std::byte* slot = nullptr;
    std::uint32_t holds = 0;
    std::uint64_t next = kNever;  ///< while nobody holds it: code of the next tile to need it
    IdleSet::node_type node;      ///< while it is held: so that release() needs no memory
  };
  std::uint64_t key(Int3 brick) const {
    return static_cast<std::uint64_t>(linear_index(brick, lattice_.bricks()));
  }
  static IdleSet::node_type new_node();
  void set_idle(std::uint64_t key, Entry& entry) noexcept;
  void drop(std::uint64_t key) noexcept;

  Lattice lattice_;
  Index reach_;
  std::uint64_t now_ = 0;
  std::unordered_map<std::uint64_t, Entry> entries_;
  IdleSet idle_;  ///< held by nobody: next use, key
  std::size_t slots_ = 0;
  std::vector<std::byte*> free_;  ///< has room for all slots
  std::vector<std::shared_ptr<std::byte>> memory_;
  std::uint64_t reads_ = 0;
  DistinctBricks bricks_read_;
};

}  // namespace isobrick
