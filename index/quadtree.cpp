#include "index/quadtree.h"

#include <algorithm>
#include <bit>

#include "index/instantiate.h"
#include "index/span_items.h"

namespace isobrick::inline v0 {

using namespace index_detail;

namespace {

/// Four bits of the min and four of the max, interleaved: a digit of the Z-order.
template <class T>
std::uint8_t z_digit(const SpanItem<T>& item, int d) {
  constexpr std::uint8_t spread[16] = {0, 1, 4, 5, 16, 17, 20, 21, 64, 65, 68, 69, 80, 81, 84, 85};
  const auto lo = static_cast<std::uint32_t>(order_key(item.lo) >> (4 * d)) & 15;
  const auto hi = static_cast<std::uint32_t>(order_key(item.hi) >> (4 * d)) & 15;
  return static_cast<std::uint8_t>(spread[lo] | spread[hi] << 1);
}

template <class T>
PodBuffer<SpanItem<T>> items_in_z_order(std::span<const ValueRange<T>> ranges) {
  PodBuffer<SpanItem<T>> items = collect_items(ranges);
  radix_sort<2 * sizeof(T)>(items, [](const SpanItem<T>& item, int d) { return z_digit(item, d); });
  return items;
}

template <class T>
struct Points {
  PodBuffer<T> mins, maxs;
  PodBuffer<std::uint32_t> first;
};

template <class T>
Points<T> group_points(const PodBuffer<SpanItem<T>>& items) {
  Points<T> points;
  points.mins.resize(items.size());
  points.maxs.resize(items.size());
  points.first.resize(items.size() + 1);
  std::size_t n = 0;
  for (std::size_t i = 0; i < items.size(); ++i) {
    if (n && points.mins[n - 1] == items[i].lo && points.maxs[n - 1] == items[i].hi) continue;
    points.mins[n] = items[i].lo;
    points.maxs[n] = items[i].hi;
    points.first[n++] = static_cast<std::uint32_t>(i);
  }
  points.first[n] = static_cast<std::uint32_t>(items.size());
  points.mins.resize(n);
  points.maxs.resize(n);
  points.first.resize(n + 1);
  return points;
}

/// Makes the nodes of points in Z-order.
template <class T>
class NodeMaker {
 public:
  explicit NodeMaker(const Points<T>& points) : points_(points) {
    const auto n = static_cast<std::uint32_t>(points.mins.size());
    if (n) add(0, n);
    nodes_.resize(count_ + 1);
    nodes_[count_] = {T(0), T(0), T(0), T(0), n, static_cast<std::uint32_t>(count_)};
  }
  const PodBuffer<QuadNode<T>>& nodes() const { return nodes_; }
  std::uint32_t count() const { return static_cast<std::uint32_t>(count_); }

 private:
  using Key = OrderKey<T>;

  /// Adds the points [begin, end) as one square. Recursion is bounded by the bits
  /// of T: the points of a child agree in one bit more.
  QuadNode<T> add(std::uint32_t begin, std::uint32_t end) {
    const std::size_t place = count_++;
    nodes_.resize(count_);
    QuadNode<T> node = end - begin <= QuadtreeView<T>::kBucket ? bounds_of_points(begin, end)
                                                               : add_quarters(begin, end);
    node.point = begin;
    node.skip = static_cast<std::uint32_t>(count_);
    nodes_[place] = node;
    return node;
  }

  /// The square's quarters, and the bounds of them all. The first and the last
  /// point differ in the highest bit in which any two do.
  QuadNode<T> add_quarters(std::uint32_t begin, std::uint32_t end) {
    const Key lo = order_key(points_.mins[begin]) ^ order_key(points_.mins[end - 1]);
    const Key hi = order_key(points_.maxs[begin]) ^ order_key(points_.maxs[end - 1]);
    const int bit = static_cast<int>(std::bit_width(static_cast<Key>(lo | hi))) - 1;
    QuadNode<T> node = nothing();
    for (int quarter = 0; quarter < 4; ++quarter) {
      const std::uint32_t next = end_of_quarter(begin, end, bit, quarter);
      if (begin < next) widen(node, add(begin, next));
      begin = next;
    }
    return node;
  }

  std::uint32_t end_of_quarter(std::uint32_t begin, std::uint32_t end, int bit, int quarter) const {
    while (begin < end) {
      const std::uint32_t middle = begin + (end - begin) / 2;
      const auto lo = static_cast<int>(order_key(points_.mins[middle]) >> bit & 1);
      const auto hi = static_cast<int>(order_key(points_.maxs[middle]) >> bit & 1);
      if (lo + 2 * hi <= quarter)
        begin = middle + 1;
      else
        end = middle;
    }
    return begin;
  }

  static QuadNode<T> nothing() {
    using Range = ValueRange<T>;
    return {Range::kHighest, Range::kLowest, Range::kHighest, Range::kLowest, 0, 0};
  }
  static void widen(QuadNode<T>& node, const QuadNode<T>& part) {
    node.min_lo = std::min(node.min_lo, part.min_lo);
    node.min_hi = std::max(node.min_hi, part.min_hi);
    node.max_lo = std::min(node.max_lo, part.max_lo);
    node.max_hi = std::max(node.max_hi, part.max_hi);
  }
  QuadNode<T> bounds_of_points(std::uint32_t begin, std::uint32_t end) const {
    QuadNode<T> node = nothing();
    for (std::uint32_t p = begin; p < end; ++p) {
      const T lo = points_.mins[p], hi = points_.maxs[p];
      widen(node, {lo, lo, hi, hi, 0, 0});
    }
    return node;
  }

  const Points<T>& points_;
  PodBuffer<QuadNode<T>> nodes_;
  std::size_t count_ = 0;
};

}  // namespace

template <class T>
std::vector<std::byte> QuadtreeView<T>::build(IndexHeader header,
                                              std::span<const ValueRange<T>> ranges) {
  const PodBuffer<SpanItem<T>> items = items_in_z_order(ranges);
  const Points<T> grouped = group_points(items);
  const NodeMaker<T> maker(grouped);
  header.stored = static_cast<std::uint32_t>(items.size());
  header.points = static_cast<std::uint32_t>(grouped.mins.size());
  header.nodes = maker.count();
  auto block = make_block<QuadtreeView>(header);
  const auto view = view_of<QuadtreeView>(header, block.data());
  std::copy(maker.nodes().begin(), maker.nodes().end(), writable(view.node));
  std::copy(grouped.first.begin(), grouped.first.end(), writable(view.first));
  std::copy(grouped.mins.begin(), grouped.mins.end(), writable(view.mins));
  std::copy(grouped.maxs.begin(), grouped.maxs.end(), writable(view.maxs));
  std::uint32_t* ids = writable(view.ids);
  for (const SpanItem<T>& item : items) *ids++ = item.id;
  return block;
}

template <class T>
void QuadtreeView<T>::check(const IndexHeader& header) const {
  require((nodes == 0) == (points == 0), "quadtree without nodes or points");
  require(first[0] == 0 && first[points] == header.stored, "lists are not those of the header");
  for (std::uint32_t p = 0; p < points; ++p)
    require(first[p] < first[p + 1], "a list ends before it begins");
  for (std::uint32_t i = 0; i < header.stored; ++i)
    require(ids[i] < header.items, "an id is out of bounds");
  require(node[0].point == 0 && node[nodes].point == points, "nodes are not those of the points");
  for (std::uint32_t i = 0; i < nodes; ++i) {
    require(node[i].skip > i && node[i].skip <= nodes, "a node leads backwards");
    require(node[i].point <= node[i + 1].point, "a node's points lie before those of the last");
  }
}

#define ISOBRICK_INSTANTIATE(T) template struct QuadtreeView<T>;
ISOBRICK_FOR_SAMPLE_TYPES(ISOBRICK_INSTANTIATE)
#undef ISOBRICK_INSTANTIATE

}  // namespace isobrick
