#include "pipeline/convert/downsample.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

namespace isobrick::inline v0 {
namespace {

/// The four rows that become one. At an odd end, and along an axis that is not halved, a row comes
/// twice: counting every sample twice leaves the mean, its rounding and the mode as they are.
template <class T>
struct Rows {
  const T *a, *b, *c, *d;
};

/// Of eight integers of 64 bits.
__extension__ using WideSum = __int128;

template <class T>
T mean_of_integers(const Rows<T>& r, Index x0, Index x1) {
  using Sum = std::conditional_t<sizeof(T) == 8, WideSum,
                                 std::conditional_t<sizeof(T) == 4, std::int64_t, std::int32_t>>;
  const auto column = [&](Index x) {
    return static_cast<Sum>(static_cast<Sum>(r.a[x]) + static_cast<Sum>(r.b[x]) +
                            static_cast<Sum>(r.c[x]) + static_cast<Sum>(r.d[x]));
  };
  // An arithmetic shift rounds down, so adding half of 8 rounds halves up.
  return static_cast<T>((column(x0) + column(x1) + 4) >> 3);
}

/// The mean where the plain sum is not finite: NaN left out, and summed in
/// eighths so that large values do not overflow on the way.
template <class T>
T mean_of_unusual(const Rows<T>& r, Index x0, Index x1) {
  double sum = 0;
  int count = 0;
  for (const T* row : {r.a, r.b, r.c, r.d})
    for (const Index x : {x0, x1})
      if (!std::isnan(row[x])) {
        sum += static_cast<double>(row[x]) * 0.125;
        ++count;
      }
  if (count == 0) return std::numeric_limits<T>::quiet_NaN();
  return static_cast<T>(sum * (8.0 / count));
}

template <class T>
double plain_sum(T a, T b, T c, T d) {
  return (static_cast<double>(a) + static_cast<double>(b)) +
         (static_cast<double>(c) + static_cast<double>(d));
}

/// Averages the pairs of a row of `width` floats, as plain_sum() does: first columns, then
/// pairs of them, which the compiler turns into vectors of any width. False where a mean is not
/// finite.
template <class T>
[[gnu::always_inline]] inline bool average_pairs(const Rows<T>& r, Index pairs, T* __restrict out) {
  constexpr Index kAtOnce = 64;
  double columns[2 * kAtOnce];
  std::uint64_t unusual = 0;
  for (Index first = 0; first < pairs; first += kAtOnce) {
    const Index count = std::min(kAtOnce, pairs - first);
    const T *a = r.a + 2 * first, *b = r.b + 2 * first, *c = r.c + 2 * first, *d = r.d + 2 * first;
    for (Index x = 0; x < 2 * count; ++x) columns[x] = plain_sum(a[x], b[x], c[x], d[x]);
    for (Index i = 0; i < count; ++i) {
      const double mean = (columns[2 * i] + columns[2 * i + 1]) * 0.125;
      out[first + i] = static_cast<T>(mean);
      unusual |= !(std::abs(mean) <= std::numeric_limits<double>::max());
    }
  }
  return !unusual;
}

#ifdef __x86_64__
/// The same with longer vectors: every operation stays what it is.
template <class T>
[[gnu::target("avx2")]] bool average_pairs_avx2(const Rows<T>& r, Index pairs, T* __restrict out) {
  return average_pairs(r, pairs, out);
}
#endif

template <class T>
bool average_pairs_fast(const Rows<T>& r, Index pairs, T* out) {
#ifdef __x86_64__
  static const bool avx2 = __builtin_cpu_supports("avx2");
  if (avx2) return average_pairs_avx2(r, pairs, out);
#endif
  return average_pairs(r, pairs, out);
}

/// Averages the columns of `width` samples, each by itself.
template <class T>
void average_columns(const Rows<T>& r, Index width, T* __restrict out) {
  for (Index x = 0; x < width; ++x) {
    if constexpr (std::is_floating_point_v<T>) {
      const double mean = plain_sum(r.a[x], r.b[x], r.c[x], r.d[x]) * 0.25;
      out[x] = std::isfinite(mean) ? static_cast<T>(mean) : mean_of_unusual(r, x, x);
    } else {
      out[x] = mean_of_integers(r, x, x);
    }
  }
}

/// Averages the pairs of a row of `width` samples.
template <class T>
void average_row(const Rows<T>& r, Index width, T* __restrict out) {
  const Index pairs = width / 2, x = width - 1;
  if constexpr (std::is_floating_point_v<T>) {
    if (!average_pairs_fast(r, pairs, out))
      for (Index i = 0; i < pairs; ++i)
        if (!std::isfinite(out[i])) out[i] = mean_of_unusual(r, 2 * i, 2 * i + 1);
    if (width % 2 == 0) return;
    const double sum = 2 * plain_sum(r.a[x], r.b[x], r.c[x], r.d[x]);
    out[pairs] = std::isfinite(sum) ? static_cast<T>(sum * 0.125) : mean_of_unusual(r, x, x);
  } else {
    for (Index i = 0; i < pairs; ++i) out[i] = mean_of_integers(r, 2 * i, 2 * i + 1);
    if (width % 2 != 0) out[pairs] = mean_of_integers(r, x, x);
  }
}

/// The most frequent of eight values, of equally frequent ones the smallest. A NaN, which equals
/// nothing, counts as none.
template <class T>
T mode_of(const std::array<T, 8>& values) {
  T mode = values.front();
  int most = 0;
  for (const T v : values) {
    int count = 0;
    for (const T other : values) count += other == v;
    if (count > most || (count == most && v < mode)) {
      most = count;
      mode = v;
    }
  }
  return mode;
}

/// `is_better(a, b)` is false for a NaN in either place.
template <class T, class Better>
T best_of(const std::array<T, 8>& values, Better is_better) {
  T best = values.front();
  for (const T v : values)
    if (is_better(v, best) || best != best) best = v;
  return best;
}

template <class T, class Reduce>
void reduce_row(const Rows<T>& r, Index width, Index factor, T* out, Reduce reduce) {
  for (Index x = 0; x < width; x += factor) {
    const Index next = std::min(x + factor - 1, width - 1);
    *out++ = reduce(std::array<T, 8>{r.a[x], r.a[next], r.b[x], r.b[next], r.c[x], r.c[next],
                                     r.d[x], r.d[next]});
  }
}

template <class T>
void reduce_row(Downsampling method, const Rows<T>& r, Index width, Index factor, T* out) {
  using Values = std::array<T, 8>;
  const auto with = [&](auto reduce) { reduce_row(r, width, factor, out, reduce); };
  switch (method) {
    case Downsampling::mean:
      if (factor == 1) return average_columns(r, width, out);
      return average_row(r, width, out);
    case Downsampling::max:
      return with([](const Values& v) { return best_of(v, [](T a, T b) { return a > b; }); });
    case Downsampling::min:
      return with([](const Values& v) { return best_of(v, [](T a, T b) { return a < b; }); });
    case Downsampling::mode: return with([](const Values& v) { return mode_of(v); });
    case Downsampling::stride: return with([](const Values& v) { return v.front(); });
  }
}

template <class T>
void downsample_typed(Downsampling method, Int3 extent, Int3 factors, const T* in, T* out) {
  const Int3 coarser = coarser_extent(extent, factors);
  const auto row = [&](Index y, Index z) {
    return in + linear_index({0, std::min(y, extent.y - 1), std::min(z, extent.z - 1)}, extent);
  };
  tbb::parallel_for(Index{0}, coarser.y * coarser.z, [&](Index i) {
    const Index y = factors.y * (i % coarser.y), z = factors.z * (i / coarser.y);
    const Index y1 = y + factors.y - 1, z1 = z + factors.z - 1;
    const Rows<T> rows{row(y, z), row(y1, z), row(y, z1), row(y1, z1)};
    reduce_row(method, rows, extent.x, factors.x, out + i * coarser.x);
  });
}

}  // namespace

Transform coarser_transform(const Transform& transform, Int3 extent, Int3 factors,
                            Downsampling method) {
  Vec3d middle;
  Transform coarser = transform;
  for (int axis = 0; axis < 3; ++axis)
    if (extent[axis] > 1) {
      const auto factor = static_cast<double>(factors[axis]);
      if (method != Downsampling::stride) middle[axis] = (factor - 1) / 2;
      coarser.spacing[axis] *= factor;
    }
  coarser.origin = transform.apply(middle);
  return coarser;
}

Int3 factors_by_spacing(const Transform& transform, Int3 extent) {
  double least = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis)
    if (extent[axis] > 1) least = std::min(least, transform.spacing[axis]);
  Int3 factors;
  for (int axis = 0; axis < 3; ++axis)
    factors[axis] = transform.spacing[axis] < std::numbers::sqrt2 * least ? 2 : 1;
  return factors;
}

void downsample(Downsampling method, ScalarType type, Int3 extent, Int3 factors,
                const std::byte* in, std::byte* out) {
  visit_sample(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    downsample_typed(method, extent, factors, reinterpret_cast<const T*>(in),
                     reinterpret_cast<T*>(out));
  });
}

}  // namespace isobrick
