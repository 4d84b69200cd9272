#include "index/kd_tree.h"

#include <algorithm>
#include <utility>

#include "index/instantiate.h"
#include "index/span_items.h"

namespace isobrick::inline v0 {

using namespace index_detail;

namespace {

/// An item's places in two total orders: by min, then max, then id; and by max,
/// then min, then id. The layout is thus a function of the items alone.
struct Ranks {
  std::uint32_t by_min, by_max;
};

/// Arranges items as a tree. Both orders are sorted once; dividing a part leaves
/// the order that divides as it is, with its median in the middle, and separates
/// the other one, which stays sorted. A level costs one pass without a branch.
template <class T>
class KdMaker {
 public:
  explicit KdMaker(PodBuffer<SpanItem<T>> items) : items_(std::move(items)) {
    sort_by_value(items_, [](const SpanItem<T>& item) { return item.hi; });
    sort_by_value(items_, [](const SpanItem<T>& item) { return item.lo; });
    rank();
    upper_.resize(items_.size());
  }
  std::uint32_t size() const { return static_cast<std::uint32_t>(items_.size()); }
  void arrange(const KdView<T>& out) { arrange(out, 0, size(), &Ranks::by_min); }

 private:
  using Axis = std::uint32_t Ranks::*;

  void rank() {
    struct Max {
      T hi;
      std::uint32_t by_min;
    };
    PodBuffer<Max> maxima;
    maxima.resize(items_.size());
    for (std::uint32_t i = 0; i < size(); ++i) maxima[i] = {items_[i].hi, i};
    sort_by_value(maxima, [](const Max& item) { return item.hi; });
    by_min_.resize(items_.size());
    by_max_.resize(items_.size());
    for (std::uint32_t i = 0; i < size(); ++i)
      by_max_[i] = by_min_[maxima[i].by_min] = {maxima[i].by_min, i};
  }

  /// Recursion halves: it is never deeper than KdView::kMaxDepth.
  void arrange(const KdView<T>& out, std::uint32_t begin, std::uint32_t end, Axis axis) {
    if (end - begin <= KdView<T>::kBucket) return place_bucket(out, begin, end);
    const std::uint32_t middle = begin + (end - begin) / 2;
    const bool min_divides = axis == &Ranks::by_min;
    const Ranks median = (min_divides ? by_min_ : by_max_)[middle];
    if (min_divides)
      separate<&Ranks::by_min>(by_max_, begin, end, median);
    else
      separate<&Ranks::by_max>(by_min_, begin, end, median);
    place(out, middle, items_[median.by_min]);
    const Axis next = min_divides ? &Ranks::by_max : &Ranks::by_min;
    arrange(out, begin, middle, next);
    arrange(out, middle + 1, end, next);
  }

  /// Moves those of `order` that come before the median along kAxis to the
  /// front, those after it to the back, both in their order. The median itself
  /// is placed already.
  template <Axis kAxis>
  void separate(PodBuffer<Ranks>& order, std::uint32_t begin, std::uint32_t end, Ranks median) {
    Ranks* const part = order.data();
    Ranks* const upper = upper_.data();
    std::uint32_t below = begin, above = 0;
    for (std::uint32_t i = begin; i < end; ++i) {
      const Ranks item = part[i];
      part[below] = item;
      upper[above] = item;
      below += item.*kAxis < median.*kAxis ? 1 : 0;
      above += item.*kAxis > median.*kAxis ? 1 : 0;
    }
    std::copy_n(upper, above, part + below + 1);
  }

  void place_bucket(const KdView<T>& out, std::uint32_t begin, std::uint32_t end) const {
    SpanItem<T> bucket[KdView<T>::kBucket];
    for (std::uint32_t i = begin; i < end; ++i) bucket[i - begin] = items_[by_min_[i].by_min];
    std::sort(bucket, bucket + (end - begin),
              [](const SpanItem<T>& a, const SpanItem<T>& b) { return a.id < b.id; });
    for (std::uint32_t i = begin; i < end; ++i) place(out, i, bucket[i - begin]);
  }

  static void place(const KdView<T>& out, std::uint32_t at, const SpanItem<T>& item) {
    writable(out.ids)[at] = item.id;
    writable(out.mins)[at] = item.lo;
    writable(out.maxs)[at] = item.hi;
  }

  PodBuffer<SpanItem<T>> items_;  ///< by min
  PodBuffer<Ranks> by_min_, by_max_;
  PodBuffer<Ranks> upper_;  ///< what `separate` moves to the back
};

}  // namespace

template <class T>
std::vector<std::byte> KdView<T>::build(IndexHeader header, std::span<const ValueRange<T>> ranges) {
  KdMaker<T> maker(collect_items(ranges));
  header.stored = maker.size();
  auto block = make_block<KdView>(header);
  maker.arrange(view_of<KdView>(header, block.data()));
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
