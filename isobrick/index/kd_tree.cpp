#include "isobrick/index/kd_tree.h"

#include <algorithm>

#include "isobrick/index/instantiate.h"
#include "isobrick/index/span_items.h"

namespace isobrick {

using namespace index_detail;

namespace {

/// Total orders: equal bounds fall back to the other bound and the id, so that
/// the layout is a function of the items alone.
struct ByMin {
  template <class T>
  bool operator()(const SpanItem<T>& a, const SpanItem<T>& b) const {
    if (a.lo != b.lo) return a.lo < b.lo;
    if (a.hi != b.hi) return a.hi < b.hi;
    return a.id < b.id;
  }
};
struct ByMax {
  template <class T>
  bool operator()(const SpanItem<T>& a, const SpanItem<T>& b) const {
    if (a.hi != b.hi) return a.hi < b.hi;
    if (a.lo != b.lo) return a.lo < b.lo;
    return a.id < b.id;
  }
};
struct ById {
  template <class T>
  bool operator()(const SpanItem<T>& a, const SpanItem<T>& b) const {
    return a.id < b.id;
  }
};

/// Recursion halves: it is never deeper than KdView::kMaxDepth.
template <class T>
void arrange(SpanItem<T>* begin, SpanItem<T>* end, bool by_max) {
  if (end - begin <= static_cast<std::ptrdiff_t>(KdView<T>::kBucket)) {
    std::sort(begin, end, ById{});
    return;
  }
  SpanItem<T>* middle = begin + (end - begin) / 2;
  if (by_max)
    std::nth_element(begin, middle, end, ByMax{});
  else
    std::nth_element(begin, middle, end, ByMin{});
  arrange(begin, middle, !by_max);
  arrange(middle + 1, end, !by_max);
}

}  // namespace

template <class T>
std::vector<std::byte> KdView<T>::build(IndexHeader header, std::span<const ValueRange<T>> ranges) {
  PodBuffer<SpanItem<T>> items = collect_items(ranges);
  arrange(items.begin(), items.end(), false);
  header.stored = static_cast<std::uint32_t>(items.size());
  auto block = make_block<KdView>(header);
  const auto view = view_of<KdView>(header, block.data());
  for (std::size_t i = 0; i < items.size(); ++i) {
    writable(view.ids)[i] = items[i].id;
    writable(view.mins)[i] = items[i].lo;
    writable(view.maxs)[i] = items[i].hi;
  }
  return block;
}

template <class T>
void KdView<T>::check(const IndexHeader& header) const {
  require(header.nodes == 0 && header.points == 0, "a k-d tree has no nodes but its items");
  for (std::uint32_t i = 0; i < stored; ++i) {
    require(ids[i] < header.items, "an id is out of bounds");
    require(mins[i] < maxs[i], "a range is empty");
  }
}

#define ISOBRICK_INSTANTIATE(T) template struct KdView<T>;
ISOBRICK_FOR_SAMPLE_TYPES(ISOBRICK_INSTANTIATE)
#undef ISOBRICK_INSTANTIATE

}  // namespace isobrick
