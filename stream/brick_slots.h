#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <unordered_map>
#include <utility>
#include <vector>

#include <isobrick/lattice.h>

namespace isobrick {

/// Comes after the code of every tile.
inline constexpr std::uint64_t kNever = ~std::uint64_t{0};

/// Morton code of the first tile at or after `code` whose samples, `reach` layers around
/// its 33³ included, lie in `brick`; kNever when there is none.
std::uint64_t next_use(const Lattice& lattice, Index reach, Int3 brick, std::uint64_t code);

/// Morton code of the last tile whose samples, as above, lie in `brick`.
std::uint64_t last_use(const Lattice& lattice, Index reach, Int3 brick);

/// Which decoded brick lies in which slot of memory. As tiles come in Morton order, it is
/// known when a brick will be needed next: where room is short, the brick goes that is not
/// needed for the longest time. Books only; not thread-safe.
class BrickSlots {
 public:
  BrickSlots(const Lattice& lattice, Index reach)
      : lattice_(lattice),
        reach_(reach),
        seen_(static_cast<std::size_t>(volume(lattice.bricks()))) {}

  /// Takes over memory for `count` bricks, one after the other.
  void add_slots(std::byte* memory, std::size_t count);
  /// All tiles before `code` have had their bricks held: what nobody holds and only they need
  /// goes.
  void advance(std::uint64_t code);

  /// Keeps a brick until release(). False when it is not here.
  bool hold(Int3 brick);
  /// Puts a brick that is not here into a slot, and holds it. Null when all slots are held.
  std::byte* place(Int3 brick);
  /// The brick, which is here, turned out to be absent: its slot is free again.
  void set_absent(Int3 brick);
  /// The brick was read and decoded.
  void count_read(Int3 brick);
  void release(Int3 brick) noexcept;

  bool contains(Int3 brick) const { return entries_.count(key(brick)) > 0; }
  /// The samples of a brick that is held; null when it is absent.
  const std::byte* find(Int3 brick) const { return entries_.at(key(brick)).slot; }
  /// Slots that nothing is lost by using.
  std::size_t free_slots() const { return free_.size(); }
  /// Bricks decoded so far, and how many different ones.
  std::uint64_t reads() const { return reads_; }
  std::uint64_t bricks_read() const { return bricks_read_; }
  /// What telling those apart takes.
  static std::uint64_t bytes(const Lattice& lattice) {
    return static_cast<std::uint64_t>(volume(lattice.bricks())) / 8;
  }

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
  std::vector<bool> seen_;
  std::uint64_t reads_ = 0, bricks_read_ = 0;
};

}  // namespace isobrick
