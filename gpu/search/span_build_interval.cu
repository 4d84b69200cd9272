#include "gpu/search/span_items.cuh"
#include "index/instantiate.h"

// The interval tree. Its split values follow from one another, each the least max
// of the items whose min is not below the one before: a path through the items by
// ascending min, all of whose places are found by doubling steps.

namespace isobrick::inline v0::gpu {
namespace {

/// All item numbers by min, max and id, and by max and id; those by min also owner
/// by owner.
struct Orders {
  DeviceBuffer<std::uint32_t> by_min, by_max;
};

template <class Key>
Orders make_orders(const DeviceItems<Key>& items, std::uint32_t owners, int bits,
                   const Stream& stream) {
  Orders orders;
  orders.by_max = first_order(items.n, stream);
  sort_order(orders.by_max, items.hi.data(), bits, stream);
  orders.by_min = copy_of(orders.by_max, stream);
  sort_order(orders.by_min, items.lo.data(), bits, stream);
  sort_order(orders.by_min, items.owner.data(), bits_below(owners), stream);
  return orders;
}

/// For each place by min the least max from there to the owner's last item; of
/// place i at n − 1 − i.
template <class Key>
DeviceBuffer<GroupValue<Key>> least_ends(const DeviceItems<Key>& items,
                                         const DeviceBuffer<std::uint32_t>& by_min,
                                         const Stream& stream) {
  DeviceBuffer<GroupValue<Key>> ends(items.n, stream);
  for_each("list_ends", items.n, stream,
           [ends = ends.data(), order = by_min.data(), owner = items.owner.data(),
            hi = items.hi.data(), n = items.n] __device__(std::uint32_t i) {
             const std::uint32_t item = order[n - 1 - i];
             ends[i] = {owner[item], hi[item]};
           });
  // Owners descend, so that another owner's end is never the least.
  least_so_far(ends.data(), items.n, stream);
  return ends;
}

/// For each place by min the first one whose item the least end from there does
/// not stab; n where there is none.
template <class Key>
DeviceBuffer<std::uint32_t> first_steps(const DeviceItems<Key>& items, std::uint32_t owners,
                                        const DeviceBuffer<std::uint32_t>& by_min,
                                        const DeviceBuffer<GroupValue<Key>>& ends,
                                        const Stream& stream) {
  DeviceBuffer<Key> minima(items.n, stream);
  for_each("gather_minima", items.n, stream,
           [minima = minima.data(), order = by_min.data(),
            lo = items.lo.data()] __device__(std::uint32_t i) { minima[i] = lo[order[i]]; });
  DeviceBuffer<std::uint32_t> steps(items.n, stream);
  for_each("first_steps", items.n, stream,
           [steps = steps.data(), minima = minima.data(), ends = ends.data(),
            first = items.first.data(), owners, n = items.n] __device__(std::uint32_t i) {
             const std::uint32_t last = first[owner_of(first, owners, i) + 1];
             const std::uint32_t to = i + count_below(minima + i, last - i, ends[n - 1 - i].value);
             steps[i] = to < last ? to : n;
           });
  return steps;
}

/// The state of following all owners' paths: marks, and whether any goes on.
struct Paths {
  std::uint32_t* marks;
  std::uint32_t* goes_on;  ///< one a round
};

/// Marks the places on the paths that begin at the owners' first items: 1, else 0,
/// and one more that is 0. A round doubles what is marked.
template <class Key>
DeviceBuffer<std::uint32_t> follow(const DeviceItems<Key>& items, std::uint32_t owners,
                                   DeviceBuffer<std::uint32_t> steps, int bits,
                                   const Stream& stream) {
  const std::uint32_t n = items.n;
  // No path is longer than there are items, or values.
  const int rounds = std::min(static_cast<int>(std::bit_width(n)), bits);
  DeviceBuffer<std::uint32_t> marks(std::size_t{n} + 1, stream);
  DeviceBuffer<std::uint32_t> goes_on(static_cast<std::size_t>(rounds) + 1, stream);
  DeviceBuffer<std::uint32_t> doubled(n, stream);
  check(cudaMemsetAsync(marks.data(), 0, marks.bytes(), stream.get()));
  check(cudaMemsetAsync(goes_on.data(), 0, goes_on.bytes(), stream.get()));
  for_each("begin_paths", owners, stream,
           [marks = marks.data(), goes_on = goes_on.data(),
            first = items.first.data()] __device__(std::uint32_t i) {
             if (first[i] == first[i + 1]) return;
             marks[first[i]] = 1;
             *goes_on = 1;
           });
  for (int round = 0; round < rounds; ++round) {
    for_each("double_steps", n, stream,
             [marks = marks.data(), goes_on = goes_on.data() + round, steps = steps.data(),
              doubled = doubled.data(), n] __device__(std::uint32_t i) {
               if (*goes_on == 0) return;
               const std::uint32_t to = steps[i];
               doubled[i] = to < n ? steps[to] : n;
               // A mark that is seen in the round that sets it marks nothing wrong.
               if (to < n && marks[i]) marks[to] = 1;
             });
    std::swap(steps, doubled);
    for_each("see_ends", owners, stream,
             [goes_on = goes_on.data() + round, steps = steps.data(), first = items.first.data(),
              n] __device__(std::uint32_t i) {
               if (goes_on[0] && first[i] < first[i + 1] && steps[first[i]] < n) goes_on[1] = 1;
             });
  }
  return marks;
}

/// The split values of all owners, one after the other.
template <class Key>
struct Splits {
  std::vector<std::uint32_t> host_first;  ///< of each owner, and their number
  DeviceBuffer<std::uint32_t> first;
  DeviceBuffer<Key> values;

  std::uint32_t count() const { return host_first.back(); }
};

template <class Key>
Splits<Key> choose_splits(const DeviceItems<Key>& items, std::uint32_t owners,
                          const DeviceBuffer<std::uint32_t>& by_min, int bits,
                          const Stream& stream) {
  const auto ends = least_ends(items, by_min, stream);
  const auto marks =
      follow(items, owners, first_steps(items, owners, by_min, ends, stream), bits, stream);
  DeviceBuffer<std::uint32_t> places(marks.size(), stream);
  exclusive_sum(marks.data(), places.data(), items.n + 1, stream);
  Splits<Key> splits;
  splits.first = gather(places.data(), items.first, stream);
  splits.host_first = download(splits.first, stream);
  splits.values = DeviceBuffer<Key>(splits.count(), stream);
  for_each("list_splits", items.n, stream,
           [marks = marks.data(), places = places.data(), ends = ends.data(),
            values = splits.values.data(), n = items.n] __device__(std::uint32_t i) {
             if (marks[i]) values[places[i]] = ends[n - 1 - i].value;
           });
  return splits;
}

/// The node of each item, counted through all owners: the highest one of those
/// whose splits stab it.
template <class Key>
DeviceBuffer<std::uint32_t> find_nodes(const DeviceItems<Key>& items, const Splits<Key>& splits,
                                       const Stream& stream) {
  DeviceBuffer<std::uint32_t> nodes(items.n, stream);
  for_each("find_nodes", items.n, stream,
           [nodes = nodes.data(), first = splits.first.data(), values = splits.values.data(),
            owner = items.owner.data(), lo = items.lo.data(),
            hi = items.hi.data()] __device__(std::uint32_t i) {
             const std::uint32_t begin = first[owner[i]], n = first[owner[i] + 1] - begin;
             const std::uint32_t before = count_up_to(values + begin, n, lo[i]);
             const std::uint32_t last = count_up_to(values + begin, n, hi[i]);
             // The rank between them with most trailing zeros.
             const int bit = 31 - __clz(static_cast<int>(before ^ last));
             nodes[i] = begin + (last >> bit << bit) - 1;
           });
  return nodes;
}

DeviceBuffer<std::uint32_t> reverse(const DeviceBuffer<std::uint32_t>& order,
                                    const Stream& stream) {
  const auto n = static_cast<std::uint32_t>(order.size());
  DeviceBuffer<std::uint32_t> out(n, stream);
  for_each("reverse", n, stream,
           [out = out.data(), order = order.data(), n] __device__(std::uint32_t i) {
             out[i] = order[n - 1 - i];
           });
  return out;
}

template <class T>
void write_lists(const DeviceItems<BoundKey<T>>& items, const Orders& orders, const BlockWriter& to,
                 const Stream& stream) {
  for_each("write_lists", items.n, stream,
           [to, first = items.first.data(), id = items.id.data(), owner = items.owner.data(),
            lo = items.lo.data(), hi = items.hi.data(), by_min = orders.by_min.data(),
            by_max = orders.by_max.data()] __device__(std::uint32_t i) {
             const std::uint32_t a = by_min[i], b = by_max[i], own = owner[a];
             const auto view = to.view<IntervalView<T>>(own);
             const std::uint32_t at = i - first[own];
             index_detail::writable(view.by_min)[at] = id[a];
             index_detail::writable(view.mins)[at] = value_of<T>(lo[a]);
             index_detail::writable(view.by_max)[at] = id[b];
             index_detail::writable(view.maxs)[at] = value_of<T>(hi[b]);
           });
}

/// `nodes`: of the items in the order of the lists.
template <class T>
void write_nodes(const DeviceItems<BoundKey<T>>& items, std::uint32_t owners,
                 const Splits<BoundKey<T>>& splits, const DeviceBuffer<std::uint32_t>& nodes,
                 const BlockWriter& to, const Stream& stream) {
  for_each("write_nodes", splits.count(), stream,
           [to, owners, first = items.first.data(), split_first = splits.first.data(),
            values = splits.values.data(), nodes = nodes.data(),
            n = items.n] __device__(std::uint32_t i) {
             const std::uint32_t owner = owner_of(split_first, owners, i);
             const auto view = to.view<IntervalView<T>>(owner);
             const std::uint32_t at = i - split_first[owner];
             index_detail::writable(view.splits)[at] = value_of<T>(values[i]);
             index_detail::writable(view.first)[at + 1] = count_up_to(nodes, n, i) - first[owner];
           });
}

}  // namespace

template <class T>
IndexBlocks build_interval_tree(const RangeBatch<T>& batch, const Stream& stream) {
  const auto items = collect(batch, stream);
  Orders orders = make_orders(items, batch.owners, kBoundBits<T>, stream);
  const auto splits = choose_splits(items, batch.owners, orders.by_min, kBoundBits<T>, stream);
  std::vector<IndexHeader> headers = batch.headers;
  for (std::size_t i = 0; i < headers.size(); ++i) {
    headers[i].stored = items.host_first[i + 1] - items.host_first[i];
    headers[i].nodes = splits.host_first[i + 1] - splits.host_first[i];
  }
  PendingBlocks pending(std::move(headers), stream);
  const auto nodes = find_nodes(items, splits, stream);
  const int bits = bits_below(splits.count());
  // Node by node: by ascending min, and by descending max and id.
  orders.by_max = reverse(orders.by_max, stream);
  sort_order(orders.by_max, nodes.data(), bits, stream);
  const auto sorted = sort_order(orders.by_min, nodes.data(), bits, stream);
  write_lists<T>(items, orders, pending.writer(), stream);
  write_nodes<T>(items, batch.owners, splits, sorted, pending.writer(), stream);
  return pending.finish(stream);
}

#define ISOBRICK_INSTANTIATE(T) \
  template IndexBlocks build_interval_tree<T>(const RangeBatch<T>&, const Stream&);
ISOBRICK_FOR_SAMPLE_TYPES(ISOBRICK_INSTANTIATE)
#undef ISOBRICK_INSTANTIATE

}  // namespace isobrick::gpu
