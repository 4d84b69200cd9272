#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include <isobrick/mesh.h>
#include "filters/scratch_array.h"

namespace isobrick::inline v0 {

/// Finds the sides of triangles that have no reverse, exactly and in bounded memory.
///
/// A side from a to b and one from b to a cancel. Triangles that share a side are mostly near in
/// the order, so few sides wait for their reverse. Those lie in a hash table by both vertices. When
/// it is full they go to a scratch file, sorted by vertices. At the end the sorted runs are merged,
/// and sides that come from several runs cancel there. Nothing depends on hash values being
/// different.
class OpenSides {
 public:
  /// An open side between vertices lo < hi: so many more sides from lo to hi than back, or fewer.
  struct Side {
    std::uint64_t key = 0;  ///< lo << 32 | hi
    std::int64_t excess = 0;

    std::uint32_t lo() const { return static_cast<std::uint32_t>(key >> 32); }
    std::uint32_t hi() const { return static_cast<std::uint32_t>(key); }
  };

  OpenSides(const ScratchPlace& place, std::uint64_t memory);

  /// Adds the three sides of a triangle. One between equal vertices is none.
  void add(const Triangle& t) {
    std::array<std::uint64_t, 3> sides;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint64_t from = t[i], to = t[(i + 1) % 3];
      sides[i] = from == to ? kNoSide : from << 32 | to;
      added_ += from != to;
      // Triangles of a cell follow each other, so many sides cancel before they need the table.
      for (std::uint64_t& before : last_)
        if (before == (to << 32 | from) && sides[i] != kNoSide) before = sides[i] = kNoSide;
    }
    add_last();
    last_ = sides;
  }
  /// Sides that were added, each triangle's on its own.
  std::uint64_t added() const { return added_; }

  /// Calls f(side) for each open side, by its vertices in ascending order. Nothing is added
  /// afterwards.
  void for_each(const std::function<void(const Side&)>& f);

  /// Frees memory and file.
  void release();
  std::uint64_t memory() const;
  /// Times that the table was full.
  std::uint64_t spills() const { return spills_; }

 private:
  struct Run {
    std::uint64_t begin, end;
  };

  /// Puts the sides of the last triangle in the table, but for those that have cancelled.
  void add_last() {
    for (const std::uint64_t side : last_)
      if (side != kNoSide)
        add_side(static_cast<std::uint32_t>(side >> 32), static_cast<std::uint32_t>(side));
    last_ = {kNoSide, kNoSide, kNoSide};
  }
  void add_side(std::uint32_t from, std::uint32_t to);
  std::size_t home_of(std::uint64_t key) const {
    return static_cast<std::size_t>(key * 0x9e3779b97f4a7c15u >> table_shift_);
  }
  void insert(std::uint64_t key, std::int64_t excess);
  void erase(std::size_t place);
  void make_table(std::size_t size);
  void grow_or_spill();
  void spill();
  void merge_runs(const std::function<void(const Side&)>& f);
  std::uint64_t buffer_sides() const { return runs_file_.memory() / sizeof(Side) / kFanIn + 1; }

  static constexpr std::uint64_t kNoSide = 0;  ///< between a vertex and itself
  static constexpr std::size_t kFanIn = 16;    ///< runs that are merged at a time

  std::array<std::uint64_t, 3> last_{};  ///< sides of the last triangle, from << 32 | to
  std::size_t max_table_;
  std::vector<Side> table_;  ///< a power of two, at most half of it in use; excess 0 is free
  unsigned table_shift_ = 0;
  std::size_t waiting_ = 0;  ///< sides in the table
  ScratchArray<Side> runs_file_, merged_file_;
  std::vector<Run> runs_;
  std::uint64_t added_ = 0, spills_ = 0;
};

}  // namespace isobrick
