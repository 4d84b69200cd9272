#include "index/interval_tree.h"

#include <algorithm>

#include "index/instantiate.h"
#include "index/span_items.h"

namespace isobrick::inline v0 {

using namespace index_detail;

namespace {

template <class T>
struct PlacedItem {
  T lo, hi;
  std::uint32_t id;
  std::uint32_t node;  ///< from 0
};

template <class T>
PodBuffer<PlacedItem<T>> items_by_max(std::span<const ValueRange<T>> ranges) {
  PodBuffer<PlacedItem<T>> items;
  items.resize(ranges.size());
  std::size_t n = 0;
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    items[n] = {canonical(ranges[i].lo), canonical(ranges[i].hi), static_cast<std::uint32_t>(i), 0};
    n += can_be_active(ranges[i]) ? 1 : 0;
  }
  items.resize(n);
  sort_by_value(items, [](const auto& item) { return item.hi; });
  return items;
}

/// The fewest values that stab every item: of those not stabbed yet the one that
/// ends first needs a split value, and its end stabs most of the others.
template <class T>
PodBuffer<T> choose_splits(std::span<const PlacedItem<T>> by_max) {
  PodBuffer<T> splits;
  for (const PlacedItem<T>& item : by_max)
    if (splits.size() == 0 || !(item.lo < splits[splits.size() - 1])) {
      splits.resize(splits.size() + 1);
      splits[splits.size() - 1] = item.hi;
    }
  return splits;
}

/// How many of the first `end` splits are <= lo: found from the back, since
/// most items are short.
template <class T>
std::uint32_t splits_up_to(const T* splits, std::uint32_t end, T lo) {
  std::uint64_t step = 1;
  while (step < end && lo < splits[end - step]) step *= 2;
  const std::uint64_t from = end > step ? end - step : 0;
  return static_cast<std::uint32_t>(std::upper_bound(splits + from, splits + end, lo) - splits);
}

/// Puts each item, by ascending max, at the highest node whose split stabs it.
template <class T>
void place_items(std::span<PlacedItem<T>> by_max, const PodBuffer<T>& splits,
                 std::uint32_t* first) {
  const auto nodes = static_cast<std::uint32_t>(splits.size());
  std::uint32_t last = 0;  // splits up to the item's max
  for (PlacedItem<T>& item : by_max) {
    while (last < nodes && splits[last] <= item.hi) ++last;
    // Ranks before + 1 … last stab the item. The highest of them in the tree is
    // the one with most trailing zeros: cut `last` at the first bit that differs.
    const std::uint32_t before = splits_up_to(splits.data(), last, item.lo);
    const auto bit = std::bit_width(before ^ last) - 1;
    item.node = (last >> bit << bit) - 1;
    ++first[item.node + 1];
  }
  for (std::uint32_t i = 0; i < nodes; ++i) first[i + 1] += first[i];
}

}  // namespace

template <class T>
std::vector<std::byte> IntervalView<T>::build(IndexHeader header,
                                              std::span<const ValueRange<T>> ranges) {
  PodBuffer<PlacedItem<T>> items = items_by_max(ranges);
  const PodBuffer<T> splits = choose_splits<T>(items.span());
  header.stored = static_cast<std::uint32_t>(items.size());
  header.nodes = static_cast<std::uint32_t>(splits.size());
  auto block = make_block<IntervalView>(header);
  const auto view = view_of<IntervalView>(header, block.data());
  std::copy(splits.begin(), splits.end(), writable(view.splits));
  place_items<T>({items.data(), items.size()}, splits, writable(view.first));

  PodBuffer<std::uint32_t> place;
  place.resize(header.nodes);
  std::copy_n(view.first, header.nodes, place.data());
  for (std::size_t i = items.size(); i-- > 0;) {
    const std::uint32_t at = place[items[i].node]++;
    writable(view.by_max)[at] = items[i].id;
    writable(view.maxs)[at] = items[i].hi;
  }
  sort_by_value(items, [](const auto& item) { return item.lo; });
  std::copy_n(view.first, header.nodes, place.data());
  for (const PlacedItem<T>& item : items) {
    const std::uint32_t at = place[item.node]++;
    writable(view.by_min)[at] = item.id;
    writable(view.mins)[at] = item.lo;
  }
  return block;
}

template <class T>
void IntervalView<T>::check(const IndexHeader& header) const {
  require(header.points == 0 && nodes <= header.stored, "interval tree has too many nodes");
  require(first[0] == 0 && first[nodes] == header.stored, "lists are not those of the header");
  for (std::uint32_t node = 0; node < nodes; ++node) {
    const T split = splits[node];
    require(node == 0 ? split == split : splits[node - 1] < split, "split values do not ascend");
    const std::uint32_t begin = first[node], end = first[node + 1];
    require(begin <= end && end <= header.stored, "a list ends before it begins");
    for (std::uint32_t i = begin; i < end; ++i) {
      require(by_min[i] < header.items && by_max[i] < header.items, "an id is out of bounds");
      require(mins[i] < split && (i == begin || mins[i - 1] <= mins[i]), "minima do not ascend");
      require(split <= maxs[i] && (i == begin || maxs[i] <= maxs[i - 1]), "maxima do not descend");
    }
  }
}

#define ISOBRICK_INSTANTIATE(T) template struct IntervalView<T>;
ISOBRICK_FOR_SAMPLE_TYPES(ISOBRICK_INSTANTIATE)
#undef ISOBRICK_INSTANTIATE

}  // namespace isobrick
