#pragma once

#include <cstdint>
#include <limits>
#include <utility>

#include <isobrick/mesh.h>
#include "filters/scratch_array.h"
#include "filters/vertex_numbers.h"

namespace isobrick::inline v0 {

/// Which vertices triangles connect: a union-find whose root is the smallest vertex of its set, so
/// that nothing depends on the order of the unions. Vertices that no triangle names are in no set.
template <class Number>
class VertexSets {
 public:
  static constexpr Number kNone = std::numeric_limits<Number>::max();

  VertexSets(const ScratchPlace& place, std::uint64_t memory) : next_(place, memory) {}

  /// More vertices, up to so many.
  void grow(std::uint64_t vertices) { next_.resize(vertices); }
  /// Connects the corners of a triangle.
  void connect(const TriangleOf<Number>& t) {
    // One after the other: a union may take a root from what was found before it.
    Number root = find(t[0]);
    root = join(root, find(t[1]));
    join(root, find(t[2]));
  }
  /// Vertices in sets, and sets.
  std::uint64_t used() const { return used_; }
  std::uint64_t sets() const { return used_ - joins_; }

  /// Afterwards root() is valid, and nothing is connected any more.
  void flatten() {
    for (std::uint64_t v = 0; v < next_.size(); ++v) {
      const Number down = next_[v];
      if (down == 0) continue;
      // Vertices before are flat already.
      const Number of_parent = next_[v - (down - 1)];
      if (of_parent > 1) next_.edit(v) = down + (of_parent - 1);
    }
  }
  /// The smallest vertex of the set, or kNone.
  Number root(std::uint64_t vertex) {
    const Number down = next_[vertex];
    return down == 0 ? kNone : static_cast<Number>(vertex - (down - 1));
  }

  std::uint64_t size() const { return next_.size(); }
  void release() { next_.release(); }
  std::uint64_t memory() const { return next_.memory(); }

 private:
  Number find(Number v) {
    Number down = next_[v];
    if (down == 0) {
      next_.edit(v) = 1;
      ++used_;
      return v;
    }
    while (down != 1) {
      const Number up = v - (down - 1), further = next_[up] - 1;
      if (further != 0) next_.edit(v) = down + further;  // halves the path
      v = up - further;
      down = next_[v];
    }
    return v;
  }
  /// The root of both.
  Number join(Number a, Number b) {
    if (a == b) return a;
    if (b < a) std::swap(a, b);
    next_.edit(b) = b - a + 1;
    ++joins_;
    return a;
  }

  /// By vertex, 1 more than the distance to a smaller one of the set; 1 of a root, and 0 where no
  /// triangle was. So new elements need no other value than the array gives them.
  ScratchArray<Number> next_;
  std::uint64_t used_ = 0, joins_ = 0;
};

}  // namespace isobrick
