#include "pipeline/volume/array_samples.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <type_traits>

#include "core/copy_rows.h"
#include "core/wide_type.h"

namespace isobrick::inline v0 {
namespace {

/// Copies samples of any strides as a loop over the axes, the nearest samples innermost.
struct StridedCopy {
  const std::byte* from;
  const std::uint8_t* mask;  ///< null: no sample is missing for its sake
  std::byte* to;
  std::optional<double> nodata;
  Int3 count, from_strides, mask_strides, to_strides;
  std::array<int, 3> axes;

  template <class From, class To, bool may_miss>
  void row(const std::byte* source, const std::uint8_t* present, std::byte* target) const {
    const int axis = axes[0];
    for (Index i = 0; i < count[axis]; ++i) {
      From stored;
      std::memcpy(&stored, source, sizeof(From));
      To value = static_cast<To>(stored);
      if constexpr (std::is_integral_v<From> && sizeof(From) == 8 && std::is_floating_point_v<To>)
        value = exact_double(stored);
      if constexpr (may_miss)
        if ((present && !*present) || (nodata && static_cast<double>(stored) == *nodata))
          value = std::numeric_limits<To>::quiet_NaN();
      std::memcpy(target, &value, sizeof(To));
      source += from_strides[axis];
      target += to_strides[axis];
      if constexpr (may_miss) present += present ? mask_strides[axis] : 0;
    }
  }

  template <class From, class To, bool may_miss>
  void run() const {
    const int middle = axes[1], outer = axes[2];
    for (Index o = 0; o < count[outer]; ++o)
      for (Index m = 0; m < count[middle]; ++m) {
        const auto offset = [&](Int3 strides) { return o * strides[outer] + m * strides[middle]; };
        row<From, To, may_miss>(from + offset(from_strides),
                                mask ? mask + offset(mask_strides) : nullptr,
                                to + offset(to_strides));
      }
  }
};

std::array<int, 3> nearest_first(Int3 strides) {
  std::array<int, 3> axes{0, 1, 2};
  std::stable_sort(axes.begin(), axes.end(),
                   [&](int a, int b) { return std::abs(strides[a]) < std::abs(strides[b]); });
  return axes;
}

/// Whether the samples can be read as those of an array of their type in C++.
bool is_aligned(const SampleArray& array) {
  const auto size = static_cast<Index>(size_of(array.type));
  const auto address = static_cast<Index>(reinterpret_cast<std::uintptr_t>(array.first));
  return address % size == 0 && array.strides.x % size == 0 && array.strides.y % size == 0 &&
         array.strides.z % size == 0;
}

}  // namespace

ScalarType ArraySamples::type_of(ScalarType stored, const MissingSamples& missing, SampleUse use) {
  if (missing.any()) return type_with_nan(stored);
  return use == SampleUse::surfaces ? surface_type(stored) : stored;
}

ArraySamples::ArraySamples(Int3 extent, const SampleArray& array, const MissingSamples& missing,
                           SampleUse use)
    : array_(array),
      missing_(missing),
      lattice_{extent, {64, 64, 64}, type_of(array.type, missing, use)},
      axes_(nearest_first(array.strides)),
      in_place_(lattice_.type == array.type && !missing.any() && is_aligned(array) &&
                array.strides[axes_[0]] == static_cast<Index>(size_of(array.type))) {}

void ArraySamples::copy(Box3 box, std::byte* to, Index row, Index plane) const {
  const Int3 n = box.extent();
  const std::byte* from = array_.at(box.lo);
  const auto size = static_cast<Index>(lattice_.sample_bytes());
  if (lattice_.type == array_.type && !missing_.any() && array_.strides.x == size) {
    const RowStrides from_strides{array_.strides.y, array_.strides.z};
    const RowStrides to_strides{row * size, plane * size};
    switch (size) {
      case 1: return copy_rows<1>(from, from_strides, to, to_strides, n);
      case 2: return copy_rows<2>(from, from_strides, to, to_strides, n);
      case 4: return copy_rows<4>(from, from_strides, to, to_strides, n);
      default: return copy_rows<8>(from, from_strides, to, to_strides, n);
    }
  }
  const StridedCopy strided{
      .from = from,
      .mask = missing_.mask ? missing_.mask + dot(box.lo, missing_.mask_strides) : nullptr,
      .to = to,
      .nodata = missing_.nodata,
      .count = n,
      .from_strides = array_.strides,
      .mask_strides = missing_.mask_strides,
      .to_strides = {size, row * size, plane * size},
      .axes = axes_};
  visit_sample(array_.type, [&](auto tag) {
    using From = typename decltype(tag)::type;
    constexpr ScalarType wide = type_with_nan(scalar_type_of<From>);
    using To = std::conditional_t<wide == ScalarType::f64, double, float>;
    if (missing_.any())
      strided.run<From, To, true>();
    else if (lattice_.type != array_.type)
      strided.run<From, To, false>();
    else
      strided.run<From, From, false>();
  });
}

void ArraySamples::copy(Box3 box, std::byte* to) const {
  const Int3 n = box.extent();
  copy(box, to, n.x, n.x * n.y);
}

void ArraySamples::gather(const TileWork& work, Index reach, const TileBlock& block) const {
  const Int3 origin = work.tile * kTileEdge;
  const auto size = static_cast<Index>(lattice_.sample_bytes());
  for_each_needed_box(lattice_, work, reach, [&](Box3 box) {
    const Int3 local = box.lo - origin;
    copy(box,
         block.samples +
             (block.origin + local.z * block.plane + local.y * block.row + local.x) * size,
         block.row, block.plane);
  });
}

}  // namespace isobrick
