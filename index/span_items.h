#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <type_traits>
#include <utility>

#include <isobrick/pod_buffer.h>
#include <isobrick/range.h>

// What the builders share: the points of span space and their sorting.

namespace isobrick::index_detail {

/// True for ranges that some isovalue stabs. Empty ranges, constant ones and
/// those with a bound that is not a number never are.
template <class T>
constexpr bool can_be_active(const ValueRange<T>& range) {
  return range.lo < range.hi;
}

template <class T>
std::uint32_t count_active(std::span<const ValueRange<T>> ranges) {
  std::uint32_t n = 0;
  for (const ValueRange<T>& range : ranges) n += can_be_active(range) ? 1 : 0;
  return n;
}

/// −0 becomes +0: equal bounds have equal bytes.
template <class T>
constexpr T canonical(T v) {
  return v == T(0) ? T(0) : v;
}

/// How ranges are stored where every item has a place: all that are never
/// active alike, so that they widen no node above them.
template <class T>
constexpr ValueRange<T> canonical(const ValueRange<T>& range) {
  if (!can_be_active(range)) return {};
  return {canonical(range.lo), canonical(range.hi)};
}

template <class T>
struct SpanItem {
  T lo, hi;
  std::uint32_t id;
};

/// The items that can be active, by ascending id.
template <class T>
PodBuffer<SpanItem<T>> collect_items(std::span<const ValueRange<T>> ranges) {
  PodBuffer<SpanItem<T>> items;
  items.resize(ranges.size());
  std::size_t n = 0;
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    items[n] = {canonical(ranges[i].lo), canonical(ranges[i].hi), static_cast<std::uint32_t>(i)};
    n += can_be_active(ranges[i]) ? 1 : 0;
  }
  items.resize(n);
  return items;
}

template <class T>
using OrderKey = std::conditional_t<
    sizeof(T) == 1, std::uint8_t,
    std::conditional_t<sizeof(T) == 2, std::uint16_t,
                       std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>>>;

/// An unsigned integer that orders as v does (−0 before +0).
template <class T>
constexpr OrderKey<T> order_key(T v) {
  using Key = OrderKey<T>;
  constexpr Key sign = static_cast<Key>(Key{1} << (8 * sizeof(T) - 1));
  const Key bits = std::bit_cast<Key>(v);
  if constexpr (std::is_floating_point_v<T>)
    return bits & sign ? ~bits : bits | sign;
  else if constexpr (std::is_signed_v<T>)
    return static_cast<Key>(bits ^ sign);
  else
    return bits;
}

/// Sorts by the digits 0 … Digits − 1, the last the most significant, each in
/// 0 … 255. Stable, O(n · Digits); digits that all items share cost no pass.
template <int Digits, class Item, class Digit>
void radix_sort(PodBuffer<Item>& items, Digit digit) {
  std::array<std::array<std::uint32_t, 256>, Digits> counts{};
  for (const Item& item : items)
    for (int d = 0; d < Digits; ++d) ++counts[static_cast<std::size_t>(d)][digit(item, d)];
  PodBuffer<Item> sorted;
  sorted.resize(items.size());
  for (int d = 0; d < Digits && items.size() > 1; ++d) {
    auto& place = counts[static_cast<std::size_t>(d)];
    if (place[digit(items[0], d)] == items.size()) continue;
    std::uint32_t sum = 0;
    for (std::uint32_t& p : place) sum += std::exchange(p, sum);
    for (const Item& item : items) sorted[place[digit(item, d)]++] = item;
    std::swap(items, sorted);
  }
}

/// Ascending by `value(item)`; those that are equal stay in their order.
template <class Item, class Value>
void sort_by_value(PodBuffer<Item>& items, Value value) {
  using T = std::remove_cvref_t<decltype(value(std::declval<const Item&>()))>;
  radix_sort<sizeof(T)>(items, [&](const Item& item, int d) {
    return static_cast<std::uint8_t>(order_key(value(item)) >> (8 * d));
  });
}

}  // namespace isobrick::index_detail
