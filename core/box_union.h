#pragma once

#include <algorithm>
#include <optional>

#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// Widens the box between two corners to hold another one.
template <class T>
constexpr void widen(Vec3<T>& lo, Vec3<T>& hi, const Vec3<T>& other_lo, const Vec3<T>& other_hi) {
  for (int axis = 0; axis < 3; ++axis) {
    lo[axis] = std::min(lo[axis], other_lo[axis]);
    hi[axis] = std::max(hi[axis], other_hi[axis]);
  }
}

/// The smallest box around two, of which an empty one adds nothing.
constexpr Box3 unite(Box3 a, const Box3& b) {
  if (a.empty() || b.empty()) return a.empty() ? b : a;
  widen(a.lo, a.hi, b.lo, b.hi);
  return a;
}

/// The smallest box around all that were included; nothing at first. A box has corners `lo` and
/// `hi`, and may be flat.
template <class Box>
class BoxUnion {
 public:
  BoxUnion() = default;
  explicit BoxUnion(std::optional<Box> box) : box_(box) {}

  void include(const Box& box) {
    if (box_)
      widen(box_->lo, box_->hi, box.lo, box.hi);
    else
      box_ = box;
  }
  /// Whether it would stay the same with `box`.
  bool covers(const Box& box) const {
    if (!box_) return false;
    for (int axis = 0; axis < 3; ++axis)
      if (box.lo[axis] < box_->lo[axis] || box.hi[axis] > box_->hi[axis]) return false;
    return true;
  }
  const std::optional<Box>& box() const { return box_; }

 private:
  std::optional<Box> box_;
};

}  // namespace isobrick
