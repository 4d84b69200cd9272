// Included once for each of Highway's targets, by packed_blocks.cpp.
#if defined(ISOBRICK_BLOCK_ENCODER_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOBRICK_BLOCK_ENCODER_INL_H
#undef ISOBRICK_BLOCK_ENCODER_INL_H
#else
#define ISOBRICK_BLOCK_ENCODER_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <iterator>

#include "packed/bit_planes.h"

HWY_BEFORE_NAMESPACE();
namespace isobrick::inline v0::packed {
namespace HWY_NAMESPACE {

/// Differences along one axis; what lies before a block counts as zero.
template <class U>
HWY_INLINE void subtract_along_x(const U* HWY_RESTRICT from, U* HWY_RESTRICT to) {
  to[0] = from[0];
  for (int i = 1; i < kBlock; ++i) to[i] = static_cast<U>(from[i] - from[i - 1]);
  for (int i = kEdge; i < kBlock; i += kEdge) to[i] = from[i];
}
template <class U>
HWY_INLINE void subtract_along_y(const U* HWY_RESTRICT from, U* HWY_RESTRICT to) {
  for (int z = 0; z < kBlock; z += kSlice) {
    for (int i = z; i < z + kEdge; ++i) to[i] = from[i];
    for (int i = z + kEdge; i < z + kSlice; ++i) to[i] = static_cast<U>(from[i] - from[i - kEdge]);
  }
}
template <class U>
HWY_INLINE void subtract_along_z(const U* HWY_RESTRICT from, U* HWY_RESTRICT to) {
  for (int i = 0; i < kSlice; ++i) to[i] = from[i];
  for (int i = kSlice; i < kBlock; ++i) to[i] = static_cast<U>(from[i] - from[i - kSlice]);
}

/// About as many bytes as the planes of these differences take: a byte for each bit that any of a
/// column's codes has.
template <class U>
HWY_INLINE unsigned estimate(const U* HWY_RESTRICT differences) {
  // As wide as vectors are, whatever the rows.
  constexpr int kLanes = sizeof(U) < 4 ? static_cast<int>(64 / sizeof(U)) : kEdge;
  constexpr std::size_t kWords = 2 * sizeof(U);  // of a row
  unsigned bytes = 0;
  for (int group = 0; group < kBlock; group += kEdge * kRows) {
    alignas(64) U codes[kLanes] = {};
    for (int i = 0; i < kEdge * kRows; i += kLanes)
      for (int lane = 0; lane < kLanes; ++lane)
        codes[lane] = static_cast<U>(codes[lane] | code_of(differences[group + i + lane]));
    std::uint64_t words[kLanes * sizeof(U) / 8];
    std::memcpy(words, codes, sizeof words);
    int bits = 0;
    std::uint64_t any = 0;
    for (std::size_t i = 0; i < kWords; ++i) {
      for (std::size_t k = kWords; k < std::size(words); k += kWords) words[i] |= words[i + k];
      bits += std::popcount(words[i]);
      any |= words[i];
    }
    for (std::size_t step = 32; step >= 8 * sizeof(U); step /= 2) any |= any >> step;
    const int planes = std::popcount(static_cast<U>(any));
    bytes += static_cast<unsigned>(std::min(bits + 2 * planes, kPlaneBytes * planes));
  }
  return bytes;
}

/// The axes of which the differences take fewest bytes; the first of equal ones.
struct AxesChoice {
  unsigned bytes = ~0u, axes = 0;

  template <class U>
  HWY_INLINE void compare(const U* differences, unsigned of) {
    const unsigned some = estimate(differences);
    if (some >= bytes) return;
    bytes = some;
    axes = of;
  }
};

template <class U>
Axes choose_axes(const U* samples) {
  alignas(64) U z[kBlock], y[kBlock], x[kBlock];
  subtract_along_z(samples, z);
  AxesChoice choice;
  for (const unsigned of_z : {0u, unsigned{along_z}}) {
    const U* const from_z = of_z ? z : samples;
    subtract_along_y(from_z, y);
    for (const unsigned of_y : {0u, unsigned{along_y}}) {
      const U* const from_y = of_y ? y : from_z;
      choice.compare(from_y, of_z | of_y);
      subtract_along_x(from_y, x);
      choice.compare(x, of_z | of_y | along_x);
    }
  }
  return static_cast<Axes>(choice.axes);
}

/// The three sections of a block that follow its groups.
template <class U>
struct Sections {
  std::uint8_t heads[kGroups * 2 * sizeof(U)];
  std::uint8_t columns[kGroups * 8 * sizeof(U) * 2];
  std::uint8_t planes[kBlock * sizeof(U)];
  std::size_t head_bytes = 0, column_bytes = 0, plane_bytes = 0;

  template <class T>
  void add_head(T value) {
    std::memcpy(heads + head_bytes, &value, sizeof value);
    head_bytes += sizeof value;
  }

  /// True where the plane is sparse.
  HWY_INLINE bool add_plane(const std::uint8_t* plane, std::uint16_t set) {
    const int count = std::popcount(set);
    std::uint8_t* to = planes + plane_bytes;
    if (count + 2 >= kPlaneBytes) {
      std::memcpy(to, plane, kPlaneBytes);
      plane_bytes += kPlaneBytes;
      return false;
    }
    std::memcpy(columns + column_bytes, &set, sizeof set);
    column_bytes += sizeof set;
    plane_bytes += static_cast<std::size_t>(count);
    for (unsigned left = set; left != 0; left &= left - 1) *to++ = plane[std::countr_zero(left)];
    return true;
  }

  std::uint8_t* write(std::uint8_t* to) const {
    std::memcpy(to, heads, head_bytes);
    std::memcpy(to += head_bytes, columns, column_bytes);
    std::memcpy(to += column_bytes, planes, plane_bytes);
    return to + plane_bytes;
  }
};

/// The columns of a plane that are not zero.
HWY_INLINE std::uint16_t columns_of(const std::uint8_t* plane) {
#if HWY_TARGET == HWY_SCALAR
  unsigned set = 0;
  for (unsigned x = 0; x < kPlaneBytes; ++x) set |= (plane[x] != 0 ? 1u : 0u) << x;
  return static_cast<std::uint16_t>(set);
#else
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::FixedTag<std::uint8_t, kPlaneBytes> d;
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(d, hn::Ne(hn::LoadU(d, plane), hn::Zero(d)), bits);
  return static_cast<std::uint16_t>(bits[0] | bits[1] << 8);
#endif
}

/// Bit planes of the codes of a slice.
template <class U>
HWY_INLINE void split(const U* HWY_RESTRICT codes, BytePlanes* planes) {
  for (std::size_t k = 0; k < sizeof(U); ++k) {
    for (int y = 0; y < kEdge; ++y) {
      std::uint8_t* const row = planes[k].row(y % kRows) + y / kRows * kPlaneBytes;
      for (int x = 0; x < kEdge; ++x)
        row[x] = static_cast<std::uint8_t>(codes[y * kEdge + x] >> (8 * k));
    }
    transpose_bits(planes[k]);
  }
}

/// Adds the groups of a slice, and returns which of them have a code that is not zero.
template <class U>
unsigned add_slice(const U* codes, Sections<U>& sections) {
  BytePlanes planes[sizeof(U)];
  split(codes, planes);
  unsigned pair = 0;
  for (unsigned half = 0; half < 2; ++half) {
    U present = 0, sparse = 0;
    for (std::size_t bit = 0; bit < 8 * sizeof(U); ++bit) {
      const std::uint8_t* const plane =
          planes[bit / 8].row(static_cast<int>(bit % 8)) + half * kPlaneBytes;
      const std::uint16_t set = columns_of(plane);
      if (set == 0) continue;
      present = static_cast<U>(present | U{1} << bit);
      if (sections.add_plane(plane, set)) sparse = static_cast<U>(sparse | U{1} << bit);
    }
    if (present == 0) continue;
    pair |= 1u << half;
    sections.add_head(present);
    sections.add_head(sparse);
  }
  return pair;
}

/// The codes of differences along `axes`.
template <class U>
void make_codes(Axes axes, U* HWY_RESTRICT samples) {
  alignas(64) U other[kBlock];
  if (axes & along_x) {
    subtract_along_x(samples, other);
    std::memcpy(samples, other, sizeof other);
  }
  if (axes & along_y) {
    subtract_along_y(samples, other);
    std::memcpy(samples, other, sizeof other);
  }
  if (axes & along_z) {
    subtract_along_z(samples, other);
    std::memcpy(samples, other, sizeof other);
  }
  for (int i = 0; i < kBlock; ++i) samples[i] = code_of(samples[i]);
}

template <class U>
std::size_t pack(const U* samples, bool floating, std::uint8_t* out) {
  alignas(64) U work[kBlock];
  const U base = floating ? ordered_of(samples[0]) : samples[0];
  U any = 0;
  for (int i = 0; i < kBlock; ++i) {
    const U value = floating ? ordered_of(samples[i]) : samples[i];
    work[i] = static_cast<U>(value - base);
    any = static_cast<U>(any | work[i]);
  }
  std::memcpy(out, &base, sizeof base);
  if (any == 0) return sizeof base;
  const Axes axes = choose_axes(work);
  make_codes(axes, work);
  Sections<U> sections;
  std::uint32_t groups = 0;
  for (int z = 0; z < kEdge; ++z) groups |= add_slice(work + z * kSlice, sections) << (2 * z);
  std::uint8_t* at = out + sizeof base;
  *at++ = axes;
  std::memcpy(at, &groups, sizeof groups);
  return static_cast<std::size_t>(sections.write(at + sizeof groups) - out);
}

}  // namespace HWY_NAMESPACE
}  // namespace isobrick::inline v0::packed
HWY_AFTER_NAMESPACE();
#endif
