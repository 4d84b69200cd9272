#include "gpu/search/span_items.cuh"
#include "index/instantiate.h"

// The k-d tree, level by level: all parts of a level are divided at once. As on
// the CPU both orders are sorted once; the one that divides a part has its median
// in the middle, the other one is separated by a stable move, for which one prefix
// sum over all items counts.

namespace isobrick::inline v0::gpu {
namespace {

/// An item's places in the orders by min and by max.
struct Ranks {
  std::uint32_t by_min, by_max;
};

/// Where a place of the tree belongs after so many divisions.
struct TreePart {
  std::uint32_t begin, end;
  bool divided;  ///< the next division divides it

  __device__ std::uint32_t middle() const { return begin + (end - begin) / 2; }
};

template <class T>
__device__ TreePart part_at(const std::uint32_t* first, std::uint32_t owners, std::uint32_t place,
                            int divisions) {
  const std::uint32_t owner = owner_of(first, owners, place);
  TreePart part{first[owner], first[owner + 1], true};
  for (;; --divisions) {
    if (part.end - part.begin <= KdView<T>::kBucket) return {part.begin, part.end, false};
    if (divisions == 0) return part;
    const std::uint32_t middle = part.middle();
    if (place == middle) return {middle, middle + 1, false};
    if (place < middle)
      part.end = middle;
    else
      part.begin = middle + 1;
  }
}

struct Orders {
  DeviceBuffer<std::uint32_t> items;  ///< by min
  DeviceBuffer<Ranks> by_min, by_max;
};

template <class Key>
Orders make_orders(const DeviceItems<Key>& items, std::uint32_t owners, int bits,
                   const Stream& stream) {
  const int owner_bits = bits_below(owners);
  Orders orders;
  orders.items = first_order(items.n, stream);
  sort_order(orders.items, items.hi.data(), bits, stream);
  sort_order(orders.items, items.lo.data(), bits, stream);
  sort_order(orders.items, items.owner.data(), owner_bits, stream);
  DeviceBuffer<std::uint32_t> max_order = copy_of(orders.items, stream);
  sort_order(max_order, items.hi.data(), bits, stream);
  sort_order(max_order, items.owner.data(), owner_bits, stream);
  DeviceBuffer<std::uint32_t> rank(items.n, stream);
  for_each("rank_by_min", items.n, stream,
           [rank = rank.data(), order = orders.items.data()] __device__(std::uint32_t i) {
             rank[order[i]] = i;
           });
  orders.by_min = DeviceBuffer<Ranks>(items.n, stream);
  orders.by_max = DeviceBuffer<Ranks>(items.n, stream);
  for_each("rank_by_max", items.n, stream,
           [rank = rank.data(), order = max_order.data(), by_min = orders.by_min.data(),
            by_max = orders.by_max.data()] __device__(std::uint32_t i) {
             const Ranks ranks{rank[order[i]], i};
             by_max[i] = ranks;
             by_min[ranks.by_min] = ranks;
           });
  return orders;
}

/// Separates every part of the order that does not divide: what comes before the
/// median along kAxis to the front, what comes after it to the back.
template <std::uint32_t Ranks::*kAxis, std::uint32_t Ranks::*kOther, class T>
void separate(const DeviceBuffer<std::uint32_t>& first, std::uint32_t owners, int divisions,
              const DeviceBuffer<Ranks>& dividing, DeviceBuffer<Ranks>& other,
              const Stream& stream) {
  const auto n = static_cast<std::uint32_t>(other.size());
  DeviceBuffer<std::uint32_t> below(std::size_t{n} + 1, stream);
  for_each("flag_below", below.size(), stream,
           [below = below.data(), first = first.data(), owners, divisions, n,
            dividing = dividing.data(), other = other.data()] __device__(std::uint32_t i) {
             bool flag = false;
             if (i < n) {
               const TreePart part = part_at<T>(first, owners, i, divisions);
               flag = part.divided && other[i].*kAxis < dividing[part.middle()].*kAxis;
             }
             below[i] = flag;
           });
  exclusive_sum(below.data(), below.data(), n + 1, stream);
  DeviceBuffer<Ranks> moved(n, stream);
  for_each(
      "separate", n, stream,
      [below = below.data(), first = first.data(), owners, divisions, dividing = dividing.data(),
       other = other.data(), moved = moved.data()] __device__(std::uint32_t i) {
        const Ranks item = other[i];
        const TreePart part = part_at<T>(first, owners, i, divisions);
        std::uint32_t to = i;
        if (part.divided) {
          const Ranks median = dividing[part.middle()];
          const std::uint32_t before = below[i] - below[part.begin];
          const std::uint32_t passed = median.*kOther < item.*kOther ? 1 : 0;
          to = item.*kAxis < median.*kAxis ? part.begin + before
               : item.*kAxis == median.*kAxis
                   ? part.middle()
                   : part.middle() + 1 + (i - part.begin) - before - passed;
        }
        moved[to] = item;
      });
  std::swap(other, moved);
}

/// Writes the items in tree order; those of a bucket by id.
template <class T>
void write_tree(const DeviceItems<BoundKey<T>>& items, std::uint32_t owners, const Orders& orders,
                const BlockWriter& to, const Stream& stream) {
  for_each("write_tree", items.n, stream,
           [to, owners, first = items.first.data(), id = items.id.data(), lo = items.lo.data(),
            hi = items.hi.data(), order = orders.items.data(),
            tree = orders.by_min.data()] __device__(std::uint32_t i) {
             const TreePart part = part_at<T>(first, owners, i, 64);
             const std::uint32_t item = order[tree[i].by_min], own = id[item];
             std::uint32_t at = part.begin;
             for (std::uint32_t j = part.begin; j < part.end; ++j)
               at += id[order[tree[j].by_min]] < own ? 1 : 0;
             const std::uint32_t owner = owner_of(first, owners, i);
             const auto view = to.view<KdView<T>>(owner);
             at -= first[owner];
             index_detail::writable(view.ids)[at] = own;
             index_detail::writable(view.mins)[at] = value_of<T>(lo[item]);
             index_detail::writable(view.maxs)[at] = value_of<T>(hi[item]);
           });
}

}  // namespace

template <class T>
IndexBlocks build_kd_tree(const RangeBatch<T>& batch, const Stream& stream) {
  const auto items = collect(batch, stream);
  std::vector<IndexHeader> headers = batch.headers;
  std::uint32_t most = 0;
  for (std::size_t i = 0; i < headers.size(); ++i) {
    headers[i].stored = items.host_first[i + 1] - items.host_first[i];
    most = std::max(most, headers[i].stored);
  }
  PendingBlocks pending(std::move(headers), stream);
  Orders orders = make_orders(items, batch.owners, kBoundBits<T>, stream);
  for (int divisions = 0; most >> divisions > KdView<T>::kBucket; ++divisions)
    if (divisions % 2 == 0)
      separate<&Ranks::by_min, &Ranks::by_max, T>(items.first, batch.owners, divisions,
                                                  orders.by_min, orders.by_max, stream);
    else
      separate<&Ranks::by_max, &Ranks::by_min, T>(items.first, batch.owners, divisions,
                                                  orders.by_max, orders.by_min, stream);
  write_tree<T>(items, batch.owners, orders, pending.writer(), stream);
  return pending.finish(stream);
}

#define ISOBRICK_INSTANTIATE(T) \
  template IndexBlocks build_kd_tree<T>(const RangeBatch<T>&, const Stream&);
ISOBRICK_FOR_SAMPLE_TYPES(ISOBRICK_INSTANTIATE)
#undef ISOBRICK_INSTANTIATE

}  // namespace isobrick::gpu
