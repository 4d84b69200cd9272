#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <functional>
#include <vector>

#include <isobrick/mesh.h>
#include "filters/scratch_array.h"
#include "filters/vertex_numbers.h"

namespace isobrick::inline v0 {

/// Two vertices in one number, the first in the higher bits, of 32 bits each; of 64 bits a struct.
template <class Number>
struct VertexPair;

template <>
struct VertexPair<std::uint32_t> {
  std::uint64_t bits = 0;

  constexpr VertexPair() = default;
  constexpr VertexPair(std::uint32_t first, std::uint32_t second)
      : bits(std::uint64_t{first} << 32 | second) {}
  std::uint32_t first() const { return static_cast<std::uint32_t>(bits >> 32); }
  std::uint32_t second() const { return static_cast<std::uint32_t>(bits); }
  std::uint64_t hash() const { return bits * 0x9e3779b97f4a7c15u; }
  friend auto operator<=>(const VertexPair&, const VertexPair&) = default;
};

template <>
struct VertexPair<std::uint64_t> {
  std::uint64_t a = 0, b = 0;

  constexpr VertexPair() = default;
  constexpr VertexPair(std::uint64_t first, std::uint64_t second) : a(first), b(second) {}
  std::uint64_t first() const { return a; }
  std::uint64_t second() const { return b; }
  std::uint64_t hash() const { return (a * 0xc2b2ae3d27d4eb4fu + b) * 0x9e3779b97f4a7c15u; }
  friend auto operator<=>(const VertexPair&, const VertexPair&) = default;
};

/// Finds the sides of triangles that have no reverse, exactly and in bounded memory.
///
/// A side from a to b and one from b to a cancel. Triangles that share a side are mostly near in
/// the order, so few sides wait for their reverse. Those lie in a hash table by both vertices. When
/// it is full they go to a scratch file, sorted by vertices. At the end the sorted runs are merged,
/// and sides that come from several runs cancel there. Nothing depends on hash values being
/// different.
template <class Number>
class OpenSides {
 public:
  /// An open side between vertices lo < hi: so many more sides from lo to hi than back, or fewer.
  struct Side {
    VertexPair<Number> key;
    std::int64_t excess = 0;

    Number lo() const { return key.first(); }
    Number hi() const { return key.second(); }
  };

  OpenSides(const ScratchPlace& place, std::uint64_t memory);

  /// Adds the three sides of a triangle. One between equal vertices is none.
  void add(const TriangleOf<Number>& t) {
    std::array<VertexPair<Number>, 3> sides;
    for (std::size_t i = 0; i < 3; ++i) {
      const Number from = t[i], to = t[(i + 1) % 3];
      sides[i] = from == to ? kNoSide : VertexPair<Number>(from, to);
      added_ += from != to;
      // Triangles of a cell follow each other, so many sides cancel before they need the table.
      for (VertexPair<Number>& before : last_)
        if (before == VertexPair<Number>(to, from) && sides[i] != kNoSide)
          before = sides[i] = kNoSide;
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
    for (const VertexPair<Number>& side : last_)
      if (side != kNoSide) add_side(side.first(), side.second());
    last_ = {kNoSide, kNoSide, kNoSide};
  }
  void add_side(Number from, Number to);
  std::size_t home_of(const VertexPair<Number>& key) const {
    return static_cast<std::size_t>(key.hash() >> table_shift_);
  }
  void insert(const VertexPair<Number>& key, std::int64_t excess);
  void erase(std::size_t place);
  void make_table(std::size_t size);
  void grow_or_spill();
  void spill();
  void merge_runs(const std::function<void(const Side&)>& f);
  std::uint64_t buffer_sides() const { return runs_file_.memory() / sizeof(Side) / kFanIn + 1; }

  static constexpr VertexPair<Number> kNoSide{};  ///< between a vertex and itself
  static constexpr std::size_t kFanIn = 16;       ///< runs that are merged at a time

  std::array<VertexPair<Number>, 3> last_{};  ///< sides of the last triangle, from and to
  std::size_t max_table_;
  std::vector<Side> table_;  ///< a power of two, at most half of it in use; excess 0 is free
  unsigned table_shift_ = 0;
  std::size_t waiting_ = 0;  ///< sides in the table
  ScratchArray<Side> runs_file_, merged_file_;
  std::vector<Run> runs_;
  std::uint64_t added_ = 0, spills_ = 0;
};

}  // namespace isobrick
