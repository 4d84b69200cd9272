#include "index/row_ranges.h"

// Highway compiles what lies in HWY_NAMESPACE once for every target below.
#define HWY_DISABLED_TARGETS \
  (HWY_SSSE3 | HWY_AVX3_DL | HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "index/row_ranges.cpp"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
//
#include <hwy/highway.h>

#include <cstdint>
#include <limits>
#include <type_traits>

#include "core/simd_targets.h"

HWY_BEFORE_NAMESPACE();
namespace isobrick::inline v0 {
namespace HWY_NAMESPACE {

/// As wide as the samples, so that loops become ones of vectors.
template <class T>
using Word = std::conditional_t<
    sizeof(T) == 1, std::uint8_t,
    std::conditional_t<sizeof(T) == 2, std::uint16_t,
                       std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>>>;

// A comparison with NaN is false, so NaN is never taken.
template <class T>
HWY_INLINE T lower(T a, T b) {
  return b < a ? b : a;
}
template <class T>
HWY_INLINE T upper(T a, T b) {
  return b > a ? b : a;
}
template <class T>
HWY_INLINE Word<T> nan_bit(T v) {
  return v != v ? Word<T>{1} : Word<T>{0};
}

/// Four rows at a time: the bounds are then loaded and stored once for all of them.
template <class T>
HWY_INLINE Word<T> merge_four(const T* __restrict a, const T* __restrict b, const T* __restrict c,
                              const T* __restrict d, Index width, T* __restrict lo,
                              T* __restrict hi) {
  Word<T> nan = 0;
  for (Index x = 0; x < width; ++x) {
    const T va = a[x], vb = b[x], vc = c[x], vd = d[x];
    lo[x] = lower(lower(lower(lower(lo[x], va), vb), vc), vd);
    hi[x] = upper(upper(upper(upper(hi[x], va), vb), vc), vd);
    if constexpr (std::numeric_limits<T>::has_quiet_NaN)
      nan = static_cast<Word<T>>(nan | nan_bit(va) | nan_bit(vb) | nan_bit(vc) | nan_bit(vd));
  }
  return nan;
}

template <class T>
bool merge(const RowBundle& bundle, T* lo, T* hi) {
  Word<T> nan = 0;
  const Index stride = bundle.row_stride;
  for (Index z = 0; z < bundle.planes; ++z) {
    const T* row = static_cast<const T*>(bundle.first) + z * bundle.plane_stride;
    Index y = 0;
    for (; y + 4 <= bundle.rows; y += 4, row += 4 * stride)
      nan = static_cast<Word<T>>(nan | merge_four(row, row + stride, row + 2 * stride,
                                                  row + 3 * stride, bundle.width, lo, hi));
    for (; y < bundle.rows; ++y, row += stride)
      nan = static_cast<Word<T>>(nan | merge_four(row, row, row, row, bundle.width, lo, hi));
  }
  return nan != 0;
}

bool merge_of_type(ScalarType type, const RowBundle& bundle, void* lo, void* hi) {
  return visit_sample(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    return merge(bundle, static_cast<T*>(lo), static_cast<T*>(hi));
  });
}

}  // namespace HWY_NAMESPACE
}  // namespace isobrick
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace isobrick::inline v0 {

bool merge_rows(ScalarType type, const RowBundle& bundle, void* lo, void* hi) {
  const auto best = ISOBRICK_BEST_OF(merge_of_type);
  return best(type, bundle, lo, hi);
}

}  // namespace isobrick
#endif  // HWY_ONCE
