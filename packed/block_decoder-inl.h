// Included once for each of Highway's targets, by packed_blocks.cpp.
#if defined(ISOBRICK_BLOCK_DECODER_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOBRICK_BLOCK_DECODER_INL_H
#undef ISOBRICK_BLOCK_DECODER_INL_H
#else
#define ISOBRICK_BLOCK_DECODER_INL_H
#endif

#include <hwy/highway.h>

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "packed/bit_planes.h"
#include "packed/expand_table.h"

HWY_BEFORE_NAMESPACE();
namespace isobrick::inline v0::packed {
namespace HWY_NAMESPACE {

/// Where the samples of a block go.
template <class U>
struct BlockTarget {
  U* samples;
  std::ptrdiff_t row, slice;
};

#if HWY_TARGET == HWY_SCALAR

/// Makes sums along x of differences, in a row of 16.
template <class U>
HWY_INLINE void add_along_x(U* HWY_RESTRICT row) {
  for (int x = 1; x < kEdge; ++x) row[x] = static_cast<U>(row[x] + row[x - 1]);
}

/// A plane of which only the bytes of some columns are there; reads 16 bytes.
HWY_INLINE void expand_plane(std::uint16_t columns, const std::uint8_t* from, std::uint8_t* to) {
  for (int x = 0; x < kPlaneBytes; ++x) to[x] = columns >> x & 1 ? *from++ : 0;
}

#else

template <class U>
HWY_INLINE void add_along_x(U* HWY_RESTRICT row) {
  namespace hn = hwy::HWY_NAMESPACE;
  constexpr std::size_t kLanes = 16 / sizeof(U);
  const hn::FixedTag<U, kLanes> d;
  auto before = hn::Zero(d);
#pragma GCC unroll 8
  for (std::size_t i = 0; i < kEdge; i += kLanes) {
    auto v = hn::Load(d, row + i);
    if constexpr (kLanes > 1) v = hn::Add(v, hn::ShiftLeftLanes<1>(d, v));
    if constexpr (kLanes > 2) v = hn::Add(v, hn::ShiftLeftLanes<2>(d, v));
    if constexpr (kLanes > 4) v = hn::Add(v, hn::ShiftLeftLanes<4>(d, v));
    if constexpr (kLanes > 8) v = hn::Add(v, hn::ShiftLeftLanes<8>(d, v));
    v = hn::Add(v, before);
    hn::Store(v, d, row + i);
    if constexpr (sizeof(U) > 1) before = hn::Set(d, row[i + kLanes - 1]);
  }
}

HWY_INLINE void expand_plane(std::uint16_t columns, const std::uint8_t* from, std::uint8_t* to) {
  namespace hn = hwy::HWY_NAMESPACE;
  const hn::FixedTag<std::uint8_t, kPlaneBytes> d;
  const hn::FixedTag<std::uint64_t, 2> words;
  const unsigned count = static_cast<unsigned>(std::popcount(columns & 0xffu));
  alignas(16) const std::uint64_t indices[2] = {
      kExpand[columns & 0xff], kExpand[columns >> 8] + 0x0101010101010101u * count};
  const auto at = hn::BitCast(d, hn::Load(words, indices));
  hn::StoreU(hn::TableLookupBytesOr0(hn::LoadU(d, from), at), d, to);
}

#endif

/// Unpacks one block.
template <class U>
class BlockDecoder {
 public:
  explicit BlockDecoder(std::span<const std::uint8_t> block)
      : at_(block.data()), end_(block.data() + block.size()) {}

  /// False for bytes that no block is packed to.
  bool decode(const BlockTarget<U>& to, bool floating) {
    if (!take(&base_, sizeof base_)) return false;
    if (at_ == end_) {
      fill(to, floating);
      return true;
    }
    if (!take(&axes_, 1) || axes_ > all_axes || !take(&groups_, sizeof groups_)) return false;
    if (!find_sections()) return false;
    return floating ? decode_slices<true>(to) : decode_slices<false>(to);
  }

 private:
  bool take(void* to, std::size_t bytes) {
    if (static_cast<std::size_t>(end_ - at_) < bytes) return false;
    std::memcpy(to, at_, bytes);
    at_ += bytes;
    return true;
  }

  /// Heads of groups, then columns of sparse planes, then planes.
  bool find_sections() {
    const std::size_t heads = static_cast<std::size_t>(std::popcount(groups_)) * 2 * sizeof(U);
    if (static_cast<std::size_t>(end_ - at_) < heads) return false;
    head_ = at_;
    columns_ = at_ += heads;
    std::size_t sparse = 0;
    for (const std::uint8_t* head = head_; head < columns_; head += 2 * sizeof(U)) {
      U some[2];
      std::memcpy(some, head, sizeof some);
      if ((some[1] & static_cast<U>(~some[0])) != 0) return false;
      sparse += static_cast<std::size_t>(std::popcount(some[1]));
    }
    if (static_cast<std::size_t>(end_ - at_) < 2 * sparse) return false;
    at_ += 2 * sparse;
    return true;
  }

  void fill(const BlockTarget<U>& to, bool floating) {
    const U value = floating ? bits_of_ordered(base_) : base_;
    for (int z = 0; z < kEdge; ++z)
      for (int y = 0; y < kEdge; ++y) {
        U* const row = to.samples + z * to.slice + y * to.row;
        for (int x = 0; x < kEdge; ++x) row[x] = value;
      }
  }

  template <bool kFloating>
  bool decode_slices(const BlockTarget<U>& to) {
    alignas(64) U differences[kSlice] = {}, slice[kSlice];
    for (int z = 0; z < kEdge; ++z) {
      const unsigned pair = groups_ >> (2 * z) & 3;
      if (pair != 0) {
        if (!add_differences(pair, differences)) return false;
      } else if (!(axes_ & along_z)) {
        std::memset(differences, 0, sizeof differences);
      }
      if (pair != 0 || z == 0 || !(axes_ & along_z)) integrate<kFloating>(differences, slice);
      for (int y = 0; y < kEdge; ++y)
        std::memcpy(to.samples + z * to.slice + y * to.row, slice + y * kEdge, kEdge * sizeof(U));
    }
    return at_ == end_;
  }

  /// The differences of a slice, or their sums along z.
  bool add_differences(unsigned pair, U* HWY_RESTRICT differences) {
    alignas(64) U codes[kSlice];
    U present[2] = {}, sparse[2] = {};
    for (unsigned half = 0; half < 2; ++half)
      if (pair >> half & 1) {
        std::memcpy(&present[half], head_, sizeof(U));
        std::memcpy(&sparse[half], head_ + sizeof(U), sizeof(U));
        head_ += 2 * sizeof(U);
      }
    BytePlanes planes[sizeof(U)] = {};
    for (unsigned half = 0; half < 2; ++half)
      if (!load_planes(planes, half, present[half], sparse[half])) return false;
    const U any = static_cast<U>(present[0] | present[1]);
    for (std::size_t k = 0; k < sizeof(U); ++k) {
      if (static_cast<std::uint8_t>(any >> (8 * k)) != 0) transpose_bits(planes[k]);
      merge(planes[k], k, codes);
    }
    if (axes_ & along_z)
      for (int i = 0; i < kSlice; ++i)
        differences[i] = static_cast<U>(differences[i] + difference_of(codes[i]));
    else
      for (int i = 0; i < kSlice; ++i) differences[i] = difference_of(codes[i]);
    return true;
  }

  /// The planes of a group that are there. Without a branch on what a plane is: none would be
  /// foretold.
  HWY_INLINE bool load_planes(BytePlanes* planes, unsigned half, U present, U sparse) {
    for (std::uint64_t left = present; left != 0; left &= left - 1) {
      const int bit = std::countr_zero(left);
      const unsigned is_sparse = static_cast<unsigned>(sparse >> bit & 1);
      std::uint16_t columns;
      if (end_ - columns_ < 2) return false;
      std::memcpy(&columns, columns_, sizeof columns);
      columns = static_cast<std::uint16_t>(columns | (is_sparse - 1));
      columns_ += 2 * is_sparse;
      const int count = std::popcount(columns);
      std::uint8_t* const to = planes[bit / 8].row(bit % 8) + half * kPlaneBytes;
      if (end_ - at_ >= kPlaneBytes) [[likely]]
        expand_plane(columns, at_, to);
      else if (!expand_last(columns, count, to))
        return false;
      at_ += count;
    }
    return true;
  }

  /// Where fewer bytes than a whole plane are left of the block.
  bool expand_last(std::uint16_t columns, int count, std::uint8_t* to) const {
    if (end_ - at_ < count) return false;
    const std::uint8_t* from = at_;
    for (int x = 0; x < kPlaneBytes; ++x) to[x] = columns >> x & 1 ? *from++ : 0;
    return true;
  }

  /// Byte k of all codes.
  static HWY_INLINE void merge(const BytePlanes& rows, std::size_t k, U* HWY_RESTRICT codes) {
    for (int y = 0; y < kEdge; ++y) {
      const std::uint8_t* const row = rows.row(y % kRows) + y / kRows * kPlaneBytes;
      U* const to = codes + y * kEdge;
      if (k == 0)
        for (int x = 0; x < kEdge; ++x) to[x] = row[x];
      else
        for (int x = 0; x < kEdge; ++x)
          to[x] = static_cast<U>(to[x] | static_cast<U>(static_cast<U>(row[x]) << (8 * k)));
    }
  }

  template <bool kFloating>
  void integrate(const U* HWY_RESTRICT differences, U* HWY_RESTRICT slice) const {
    std::memcpy(slice, differences, kSlice * sizeof(U));
    if (axes_ & along_x)
      for (int y = 0; y < kEdge; ++y) add_along_x(slice + y * kEdge);
    if (axes_ & along_y)
      for (int i = kEdge; i < kSlice; i += kEdge)
        for (int x = 0; x < kEdge; ++x)
          slice[i + x] = static_cast<U>(slice[i + x] + slice[i + x - kEdge]);
    for (int i = 0; i < kSlice; ++i) {
      const U value = static_cast<U>(slice[i] + base_);
      slice[i] = kFloating ? bits_of_ordered(value) : value;
    }
  }

  const std::uint8_t *at_, *end_;  ///< what is left; in the end of the planes
  const std::uint8_t *head_ = nullptr, *columns_ = nullptr;
  U base_ = 0;
  std::uint8_t axes_ = 0;
  std::uint32_t groups_ = 0;
};

}  // namespace HWY_NAMESPACE
}  // namespace isobrick::inline v0::packed
HWY_AFTER_NAMESPACE();
#endif
