#include "isobrick/pipeline/downsample.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace isobrick {
namespace {

/// The four rows that are averaged. At an odd end a row comes twice: counting
/// every sample twice leaves the mean, and its rounding, as it is.
template <class T>
struct Rows {
  const T *a, *b, *c, *d;
};

template <class T>
T mean_of_integers(const Rows<T>& r, Index x0, Index x1) {
  using Sum = std::conditional_t<sizeof(T) == 4, std::int64_t, std::int32_t>;
  const auto column = [&](Index x) {
    return static_cast<Sum>(static_cast<Sum>(r.a[x]) + r.b[x] + r.c[x] + r.d[x]);
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
double plain_sum(const Rows<T>& r, Index x0, Index x1) {
  const auto column = [&](Index x) {
    return (static_cast<double>(r.a[x]) + static_cast<double>(r.b[x])) +
           (static_cast<double>(r.c[x]) + static_cast<double>(r.d[x]));
  };
  return column(x0) + column(x1);
}

/// Averages the pairs of a row of `width` samples.
template <class T>
void average_row(const Rows<T>& r, Index width, T* __restrict out) {
  const Index pairs = width / 2;
  if constexpr (std::is_floating_point_v<T>) {
    bool finite = true;
    for (Index i = 0; i < pairs; ++i) {
      const double mean = plain_sum(r, 2 * i, 2 * i + 1) * 0.125;
      out[i] = static_cast<T>(mean);
      finite &= std::abs(mean) <= std::numeric_limits<double>::max();
    }
    if (!finite)
      for (Index i = 0; i < pairs; ++i)
        if (!std::isfinite(out[i])) out[i] = mean_of_unusual(r, 2 * i, 2 * i + 1);
    if (width % 2 == 0) return;
    const double sum = plain_sum(r, width - 1, width - 1);
    out[pairs] =
        std::isfinite(sum) ? static_cast<T>(sum * 0.125) : mean_of_unusual(r, width - 1, width - 1);
  } else {
    for (Index i = 0; i < pairs; ++i) out[i] = mean_of_integers(r, 2 * i, 2 * i + 1);
    if (width % 2 != 0) out[pairs] = mean_of_integers(r, width - 1, width - 1);
  }
}

template <class T>
void downsample_typed(Int3 extent, const T* in, T* out) {
  const Int3 half = half_extent(extent);
  const auto row = [&](Index y, Index z) {
    return in + linear_index({0, std::min(y, extent.y - 1), std::min(z, extent.z - 1)}, extent);
  };
  tbb::parallel_for(Index{0}, half.y * half.z, [&](Index i) {
    const Index y = 2 * (i % half.y), z = 2 * (i / half.y);
    const Rows<T> rows{row(y, z), row(y + 1, z), row(y, z + 1), row(y + 1, z + 1)};
    average_row(rows, extent.x, out + i * half.x);
  });
}

}  // namespace

Transform half_transform(const Transform& transform, Int3 extent) {
  Vec3d middle;
  Transform half = transform;
  for (int axis = 0; axis < 3; ++axis)
    if (extent[axis] > 1) {
      middle[axis] = 0.5;
      half.spacing[axis] *= 2;
    }
  half.origin = transform.apply(middle);
  return half;
}

void downsample(ScalarType type, Int3 extent, const std::byte* in, std::byte* out) {
  visit_scalar(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    downsample_typed(extent, reinterpret_cast<const T*>(in), reinterpret_cast<T*>(out));
  });
}

}  // namespace isobrick
