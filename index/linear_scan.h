#pragma once

#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include <isobrick/range.h>
#include "core/host_device.h"
#include "index/index_format.h"

namespace isobrick::inline v0 {

/// All ranges one after the other; an item's id is its place.
template <class T>
struct LinearView {
  std::uint32_t items;
  const T* mins;
  const T* maxs;

  ISOBRICK_HD LinearView(const IndexHeader& header, SectionCursor& cursor)
      : items(header.items),
        mins(cursor.take<T>(header.items)),
        maxs(cursor.take<T>(header.items)) {}

  static std::vector<std::byte> build(IndexHeader header, std::span<const ValueRange<T>> ranges);
  void check(const IndexHeader& header) const;
};

namespace index_detail {

/// Bit j: item j of 64 is stabbed. Comparisons go through bytes, which
/// compilers turn into vector instructions.
template <class T>
ISOBRICK_HD inline std::uint64_t stabbed_word(const T* mins, const T* maxs, T value) {
  std::uint8_t flags[64];
  for (int j = 0; j < 64; ++j)
    flags[j] = static_cast<std::uint8_t>((mins[j] < value) & (value <= maxs[j]));
  std::uint64_t word = 0;
  for (int j = 0; j < 8; ++j) {
    std::uint64_t eight;
    std::memcpy(&eight, flags + 8 * j, 8);
    word |= (eight * 0x0102040810204080ULL >> 56) << (8 * j);
  }
  return word;
}

}  // namespace index_detail

/// Reports the stabbed items by ascending id.
template <class T, class Sink>
ISOBRICK_HD void traverse(const LinearView<T>& index, T value, Sink& sink) {
  sink.tested(index.items);
  const std::uint32_t whole = index.items & ~std::uint32_t{63};
  for (std::uint32_t i = 0; i < whole; i += 64)
    if (const std::uint64_t word =
            index_detail::stabbed_word(index.mins + i, index.maxs + i, value))
      sink.bits(i, word);
  std::uint64_t rest = 0;
  for (std::uint32_t i = whole; i < index.items; ++i)
    rest |= static_cast<std::uint64_t>((index.mins[i] < value) & (value <= index.maxs[i]))
            << (i - whole);
  if (rest) sink.bits(whole, rest);
}

}  // namespace isobrick
