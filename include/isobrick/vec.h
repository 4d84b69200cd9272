#pragma once

#include <cstdint>

namespace isobrick::inline v0 {

/// Signed 64-bit lattice arithmetic: extents, coordinates and offsets all fit,
/// and a negative intermediate result is a bug that shows.
using Index = std::int64_t;

/// Three components in the order x, y, z (x fastest in memory).
template <class T>
struct Vec3 {
  T x{};  ///< the component that is fastest in memory
  T y{};  ///< the middle component
  T z{};  ///< the slowest component

  friend constexpr bool operator==(const Vec3&, const Vec3&) = default;
  /// Component 0, 1, 2 for x, y, z.
  constexpr T& operator[](int axis) { return axis == 0 ? x : axis == 1 ? y : z; }
  /// The same for reading.
  constexpr const T& operator[](int axis) const { return axis == 0 ? x : axis == 1 ? y : z; }

  /// Componentwise sum.
  friend constexpr Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  /// Componentwise difference.
  friend constexpr Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  /// Componentwise product.
  friend constexpr Vec3 operator*(Vec3 a, Vec3 b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
  /// Every component times `s`.
  friend constexpr Vec3 operator*(Vec3 a, T s) { return {a.x * s, a.y * s, a.z * s}; }
};

/// Lattice points, extents and offsets, in samples.
using Int3 = Vec3<Index>;
/// Positions and normals of meshes.
using Vec3f = Vec3<float>;
/// World space.
using Vec3d = Vec3<double>;

/// Componentwise ⌈a / b⌉ for a >= 0, b > 0.
constexpr Int3 ceil_div(Int3 a, Int3 b) {
  return {(a.x + b.x - 1) / b.x, (a.y + b.y - 1) / b.y, (a.z + b.z - 1) / b.z};
}
/// ⌈a / b⌉ for a >= 0, b > 0.
constexpr Index ceil_div(Index a, Index b) { return (a + b - 1) / b; }
/// Componentwise ⌊a / b⌋ for a >= 0, b > 0.
constexpr Int3 floor_div(Int3 a, Int3 b) { return {a.x / b.x, a.y / b.y, a.z / b.z}; }

/// Scalar product.
template <class T>
constexpr T dot(Vec3<T> a, Vec3<T> b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
/// Vector product.
template <class T>
constexpr Vec3<T> cross(Vec3<T> a, Vec3<T> b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/// Componentwise minimum.
constexpr Int3 min(Int3 a, Int3 b) {
  return {a.x < b.x ? a.x : b.x, a.y < b.y ? a.y : b.y, a.z < b.z ? a.z : b.z};
}
/// Componentwise maximum.
constexpr Int3 max(Int3 a, Int3 b) {
  return {a.x > b.x ? a.x : b.x, a.y > b.y ? a.y : b.y, a.z > b.z ? a.z : b.z};
}

/// Product of the components. The caller knows that it fits (see checked_volume).
constexpr Index volume(Int3 e) { return e.x * e.y * e.z; }

/// Offset of `p` in a C-ordered array [z, y, x] of `extent`.
constexpr Index linear_index(Int3 p, Int3 extent) {
  return (p.z * extent.y + p.y) * extent.x + p.x;
}

/// The point at an offset in such an array: the inverse of linear_index().
constexpr Int3 point_at(Index offset, Int3 extent) {
  return {offset % extent.x, offset / extent.x % extent.y, offset / extent.x / extent.y};
}

/// Half-open box of lattice points [lo, hi).
struct Box3 {
  Int3 lo;  ///< the first point along each axis
  Int3 hi;  ///< behind the last point along each axis

  friend constexpr bool operator==(const Box3&, const Box3&) = default;
  /// Points along each axis.
  constexpr Int3 extent() const { return hi - lo; }
  /// True when it holds no point.
  constexpr bool empty() const { return hi.x <= lo.x || hi.y <= lo.y || hi.z <= lo.z; }
  /// Whether `p` is one of its points.
  constexpr bool contains(Int3 p) const {
    return p.x >= lo.x && p.y >= lo.y && p.z >= lo.z && p.x < hi.x && p.y < hi.y && p.z < hi.z;
  }
};

/// The points that both hold; empty() when there are none.
constexpr Box3 intersect(Box3 a, Box3 b) { return {max(a.lo, b.lo), min(a.hi, b.hi)}; }

/// Calls f(p) for every point of the box, x fastest.
template <class F>
constexpr void for_each_point(Box3 box, F&& f) {
  for (Index z = box.lo.z; z < box.hi.z; ++z)
    for (Index y = box.lo.y; y < box.hi.y; ++y)
      for (Index x = box.lo.x; x < box.hi.x; ++x) f(Int3{x, y, z});
}

}  // namespace isobrick
