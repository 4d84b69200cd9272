#pragma once

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <array>
#include <cstdint>
#include <string>

#include <isobrick/label.h>
#include <isobrick/scalar.h>
#include <isobrick/vec.h>

// What indexes samples is [z, y, x] in Python, as arrays are. World space is x, y, z.
namespace pybind11::detail {

/// Lattice points and extents: (z, y, x).
template <>
struct type_caster<isobrick::Int3> {
  PYBIND11_TYPE_CASTER(isobrick::Int3, const_name("tuple[int, int, int]"));

  bool load(handle source, bool convert) {
    make_caster<std::array<isobrick::Index, 3>> caster;
    if (!caster.load(source, convert)) return false;
    const auto& zyx = cast_op<std::array<isobrick::Index, 3>&>(caster);
    value = {zyx[2], zyx[1], zyx[0]};
    return true;
  }
  static handle cast(isobrick::Int3 p, return_value_policy, handle) {
    return make_tuple(p.z, p.y, p.x).release();
  }
};

/// World space: (x, y, z).
template <>
struct type_caster<isobrick::Vec3d> {
  PYBIND11_TYPE_CASTER(isobrick::Vec3d, const_name("tuple[float, float, float]"));

  bool load(handle source, bool convert) {
    make_caster<std::array<double, 3>> caster;
    if (!caster.load(source, convert)) return false;
    const auto& xyz = cast_op<std::array<double, 3>&>(caster);
    value = {xyz[0], xyz[1], xyz[2]};
    return true;
  }
  static handle cast(isobrick::Vec3d p, return_value_policy, handle) {
    return make_tuple(p.x, p.y, p.z).release();
  }
};

/// ((z, y, x), (z, y, x)): the first sample, and behind the last one.
template <>
struct type_caster<isobrick::Box3> {
  PYBIND11_TYPE_CASTER(isobrick::Box3, const_name("tuple[tuple[int, int, int], ...]"));

  bool load(handle source, bool convert) {
    make_caster<std::array<isobrick::Int3, 2>> caster;
    if (!caster.load(source, convert)) return false;
    const auto& corners = cast_op<std::array<isobrick::Int3, 2>&>(caster);
    value = {corners[0], corners[1]};
    return true;
  }
  static handle cast(isobrick::Box3 box, return_value_policy, handle) {
    return make_tuple(box.lo, box.hi).release();
  }
};

/// Integers.
template <>
struct type_caster<isobrick::Label> {
  PYBIND11_TYPE_CASTER(isobrick::Label, const_name("int"));

  bool load(handle source, bool convert) {
    make_caster<std::int64_t> with_sign;
    make_caster<std::uint64_t> without_sign;
    if (with_sign.load(source, convert))
      value = cast_op<std::int64_t>(with_sign);
    else if (without_sign.load(source, convert))
      value = cast_op<std::uint64_t>(without_sign);
    else
      return false;
    return true;
  }
  static handle cast(const isobrick::Label& label, return_value_policy, handle) {
    if (const auto integer = label.as_signed()) return int_(*integer).release();
    return int_(label.bits()).release();
  }
};

/// The names of NumPy: "uint8", "float32", ….
template <>
struct type_caster<isobrick::ScalarType> {
  PYBIND11_TYPE_CASTER(isobrick::ScalarType, const_name("str"));

  bool load(handle source, bool convert) {
    make_caster<std::string> caster;
    if (!caster.load(source, convert)) return false;
    const auto type = isobrick::parse_scalar_type(cast_op<const std::string&>(caster));
    if (type) value = *type;
    return type.has_value();
  }
  static handle cast(isobrick::ScalarType type, return_value_policy, handle) {
    return str(std::string(isobrick::zarr_name(type))).release();
  }
};

}  // namespace pybind11::detail
