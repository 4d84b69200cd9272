#include "gpu/search/span_items.cuh"
#include "index/instantiate.h"

// The quadtree: items sorted along the Z-curve, then squares cut in four level by
// level, each by one thread; bounds and sizes from the last level upwards, and with
// them the place of each square before its descendants.

namespace isobrick::inline v0::gpu {
namespace {

/// Bit i of the lower 32 bits becomes bit 2·i.
__device__ inline std::uint64_t spread(std::uint64_t v) {
  v &= 0xffffffffu;
  v = (v | v << 16) & 0x0000ffff0000ffffu;
  v = (v | v << 8) & 0x00ff00ff00ff00ffu;
  v = (v | v << 4) & 0x0f0f0f0f0f0f0f0fu;
  v = (v | v << 2) & 0x3333333333333333u;
  return (v | v << 1) & 0x5555555555555555u;
}

/// Item numbers by owner, place on the Z-curve and id.
template <class Key>
DeviceBuffer<std::uint32_t> z_order(const DeviceItems<Key>& items, std::uint32_t owners, int bits,
                                    const Stream& stream) {
  DeviceBuffer<std::uint32_t> order = first_order(items.n, stream);
  DeviceBuffer<std::uint64_t> z(items.n, stream);
  for (int shift = 0; shift < bits; shift += 32) {
    for_each("interleave", items.n, stream,
             [z = z.data(), lo = items.lo.data(), hi = items.hi.data(), shift] __device__(
                 std::uint32_t i) { z[i] = spread(lo[i] >> shift) | spread(hi[i] >> shift) << 1; });
    sort_order(order, z.data(), 2 * std::min(bits, 32), stream);
  }
  sort_order(order, items.owner.data(), bits_below(owners), stream);
  return order;
}

/// The distinct (min, max) of each owner, in that order.
template <class Key>
struct DevicePoints {
  std::uint32_t n = 0;
  std::vector<std::uint32_t> host_first;  ///< of each owner, and n
  DeviceBuffer<std::uint32_t> first;      ///< the same
  DeviceBuffer<std::uint32_t> item;       ///< place of each point's first item; and of the end
  DeviceBuffer<Key> lo, hi;
};

template <class Key>
DevicePoints<Key> group_points(const DeviceItems<Key>& items,
                               const DeviceBuffer<std::uint32_t>& order, const Stream& stream) {
  const std::uint32_t n = items.n;
  DeviceBuffer<std::uint32_t> begins(std::size_t{n} + 1, stream), places(begins.size(), stream);
  for_each("flag_points", begins.size(), stream,
           [begins = begins.data(), order = order.data(), owner = items.owner.data(),
            lo = items.lo.data(), hi = items.hi.data(), n] __device__(std::uint32_t i) {
             bool begin = i < n;
             if (begin && i > 0) {
               const std::uint32_t a = order[i - 1], b = order[i];
               begin = lo[a] != lo[b] || hi[a] != hi[b] || owner[a] != owner[b];
             }
             begins[i] = begin;
           });
  exclusive_sum(begins.data(), places.data(), n + 1, stream);
  DevicePoints<Key> points;
  points.first = gather(places.data(), items.first, stream);
  points.host_first = download(points.first, stream);
  points.n = points.host_first.back();
  points.item = DeviceBuffer<std::uint32_t>(std::size_t{points.n} + 1, stream);
  points.lo = DeviceBuffer<Key>(points.n, stream);
  points.hi = DeviceBuffer<Key>(points.n, stream);
  for_each(
      "list_points", begins.size(), stream,
      [begins = begins.data(), places = places.data(), order = order.data(), lo = items.lo.data(),
       hi = items.hi.data(), item = points.item.data(), point_lo = points.lo.data(),
       point_hi = points.hi.data(), n] __device__(std::uint32_t i) {
        if (i < n && !begins[i]) return;
        item[places[i]] = i;
        if (i == n) return;
        point_lo[places[i]] = lo[order[i]];
        point_hi[places[i]] = hi[order[i]];
      });
  return points;
}

/// A square while the tree is made.
template <class Key>
struct Square {
  std::uint32_t begin, end;                ///< its points
  std::uint32_t children, children_count;  ///< lie one after the other, one level deeper
  std::uint32_t size;                      ///< squares with its descendants
  std::uint32_t place;                     ///< among those of its owner, before its descendants
  Key min_lo, min_hi, max_lo, max_hi;
};

template <class Key>
struct Tree {
  int levels;
  DeviceBuffer<Square<Key>> squares;  ///< level by level
  DeviceBuffer<std::uint32_t> first;  ///< of each level, and of two behind the last
  DeviceBuffer<std::uint32_t> root;   ///< of each owner that has points
};

/// Calls f(i) on the device for the places range[0] … range[1] − 1.
template <class F>
__global__ void __launch_bounds__(256) each_between(const std::uint32_t* range, F f) {
  for (std::uint64_t i = range[0] + blockIdx.x * 256ull + threadIdx.x; i < range[1];
       i += gridDim.x * 256ull)
    f(static_cast<std::uint32_t>(i));
}

template <class F>
void for_each_of_level(const char* name, const std::uint32_t* range, std::uint32_t most,
                       const Stream& stream, F f) {
  each_between<<<std::min((most + 255) / 256, 2048u), 256, 0, stream.get()>>>(range, f);
  check_launch(name);
}

/// The points [begin, end) of a square by quarters, of which at least two have some.
template <class Key>
struct Quarters {
  std::uint32_t end[4];
  std::uint32_t count = 0;

  __device__ Quarters(const Key* lo, const Key* hi, std::uint32_t begin, std::uint32_t last) {
    // The first and the last point differ in the highest bit in which any two do.
    const std::uint64_t differ = (lo[begin] ^ lo[last - 1]) | (hi[begin] ^ hi[last - 1]);
    const int bit = 63 - __clzll(static_cast<long long>(differ));
    for (unsigned quarter = 0; quarter < 4; ++quarter) {
      const std::uint32_t points = partition_point(last - begin, [&](std::uint32_t i) {
        const Key x = lo[begin + i] >> bit & 1u, y = hi[begin + i] >> bit & 1u;
        return static_cast<unsigned>(x | y << 1) <= quarter;
      });
      begin += points;
      end[quarter] = begin;
      count += points > 0;
    }
  }
};

template <class T>
void divide(const DevicePoints<BoundKey<T>>& points, Tree<BoundKey<T>>& tree,
            const Stream& stream) {
  // The number of squares so far lies behind the end of the level that is divided.
  for (int level = 0; level < tree.levels; ++level) {
    std::uint32_t* const first = tree.first.data() + level;
    check(cudaMemcpyAsync(first + 2, first + 1, sizeof *first, cudaMemcpyDeviceToDevice,
                          stream.get()));
    for_each_of_level("divide", first, points.n, stream,
                      [squares = tree.squares.data(), made = first + 2, lo = points.lo.data(),
                       hi = points.hi.data()] __device__(std::uint32_t i) {
                        Square<BoundKey<T>>& square = squares[i];
                        if (square.end - square.begin <= QuadtreeView<T>::kBucket) return;
                        const Quarters<BoundKey<T>> quarters(lo, hi, square.begin, square.end);
                        square.children_count = quarters.count;
                        std::uint32_t child = square.children = atomicAdd(made, quarters.count);
                        std::uint32_t begin = square.begin;
                        for (const std::uint32_t end : quarters.end) {
                          if (begin == end) continue;
                          squares[child++] = {begin, end, 0, 0, 1, 0, 0, 0, 0, 0};
                          begin = end;
                        }
                      });
  }
}

/// Bounds and sizes of a level's squares from those of the level below.
template <class T>
void sum_up(const DevicePoints<BoundKey<T>>& points, const Tree<BoundKey<T>>& tree, int level,
            const Stream& stream) {
  using Key = BoundKey<T>;
  for_each_of_level("sum_up", tree.first.data() + level, points.n, stream,
                    [squares = tree.squares.data(), lo = points.lo.data(),
                     hi = points.hi.data()] __device__(std::uint32_t i) {
                      Square<Key> s = squares[i];
                      s.size = 1;
                      s.min_lo = s.max_lo = ~Key{0};
                      s.min_hi = s.max_hi = 0;
                      for (std::uint32_t c = s.children; c < s.children + s.children_count; ++c) {
                        const Square<Key>& child = squares[c];
                        s.size += child.size;
                        s.min_lo = ::min(s.min_lo, child.min_lo);
                        s.min_hi = ::max(s.min_hi, child.min_hi);
                        s.max_lo = ::min(s.max_lo, child.max_lo);
                        s.max_hi = ::max(s.max_hi, child.max_hi);
                      }
                      for (std::uint32_t p = s.begin; s.children_count == 0 && p < s.end; ++p) {
                        s.min_lo = ::min(s.min_lo, lo[p]);
                        s.min_hi = ::max(s.min_hi, lo[p]);
                        s.max_lo = ::min(s.max_lo, hi[p]);
                        s.max_hi = ::max(s.max_hi, hi[p]);
                      }
                      squares[i] = s;
                    });
}

/// Places of the children of a level's squares.
template <class T>
void number_down(const DevicePoints<BoundKey<T>>& points, const Tree<BoundKey<T>>& tree, int level,
                 const Stream& stream) {
  for_each_of_level("number_down", tree.first.data() + level, points.n, stream,
                    [squares = tree.squares.data()] __device__(std::uint32_t i) {
                      std::uint32_t place = squares[i].place + 1;
                      for (std::uint32_t c = 0; c < squares[i].children_count; ++c) {
                        auto& child = squares[squares[i].children + c];
                        child.place = place;
                        place += child.size;
                      }
                    });
}

template <class T>
Tree<BoundKey<T>> make_tree(const DevicePoints<BoundKey<T>>& points, std::uint32_t owners,
                            const Stream& stream) {
  Tree<BoundKey<T>> tree;
  // Points of a child agree in one bit more; every divided square has two children
  // at least.
  tree.levels = kBoundBits<T> + 1;
  tree.squares = DeviceBuffer<Square<BoundKey<T>>>(2 * std::size_t{points.n}, stream);
  tree.first = DeviceBuffer<std::uint32_t>(static_cast<std::size_t>(tree.levels) + 2, stream);
  tree.root = DeviceBuffer<std::uint32_t>(owners, stream);
  check(cudaMemsetAsync(tree.first.data(), 0, tree.first.bytes(), stream.get()));
  for_each("add_roots", owners, stream,
           [squares = tree.squares.data(), made = tree.first.data() + 1, root = tree.root.data(),
            first = points.first.data()] __device__(std::uint32_t i) {
             root[i] = 0;
             if (first[i] == first[i + 1]) return;
             root[i] = atomicAdd(made, 1u);
             squares[root[i]] = {first[i], first[i + 1], 0, 0, 1, 0, 0, 0, 0, 0};
           });
  divide<T>(points, tree, stream);
  for (int level = tree.levels; level-- > 0;) sum_up<T>(points, tree, level, stream);
  for (int level = 0; level < tree.levels; ++level) number_down<T>(points, tree, level, stream);
  return tree;
}

/// Squares of each owner.
template <class T>
std::vector<std::uint32_t> count_squares(const DevicePoints<BoundKey<T>>& points,
                                         const Tree<BoundKey<T>>& tree, const Stream& stream) {
  DeviceBuffer<std::uint32_t> counts(tree.root.size(), stream);
  for_each("count_squares", counts.size(), stream,
           [counts = counts.data(), squares = tree.squares.data(), root = tree.root.data(),
            first = points.first.data()] __device__(std::uint32_t i) {
             counts[i] = first[i] < first[i + 1] ? squares[root[i]].size : 0;
           });
  return download(counts, stream);
}

template <class T>
void write_nodes(const DevicePoints<BoundKey<T>>& points, const Tree<BoundKey<T>>& tree,
                 std::uint32_t owners, std::uint64_t nodes, const BlockWriter& to,
                 const Stream& stream) {
  for_each("write_nodes", nodes, stream,
           [to, owners, squares = tree.squares.data(),
            first = points.first.data()] __device__(std::uint32_t i) {
             const Square<BoundKey<T>> s = squares[i];
             const std::uint32_t owner = owner_of(first, owners, s.begin);
             const auto view = to.view<QuadtreeView<T>>(owner);
             index_detail::writable(view.node)[s.place] = {
                 value_of<T>(s.min_lo), value_of<T>(s.min_hi),  value_of<T>(s.max_lo),
                 value_of<T>(s.max_hi), s.begin - first[owner], s.place + s.size};
           });
  for_each("write_ends", owners, stream, [to] __device__(std::uint32_t i) {
    const auto view = to.view<QuadtreeView<T>>(i);
    index_detail::writable(view.node)[view.nodes] = {T(0), T(0),        T(0),
                                                     T(0), view.points, view.nodes};
    index_detail::writable(view.first)[view.points] = to.header(i).stored;
  });
}

template <class T>
void write_points(const DeviceItems<BoundKey<T>>& items, const DevicePoints<BoundKey<T>>& points,
                  const DeviceBuffer<std::uint32_t>& order, std::uint32_t owners,
                  const BlockWriter& to, const Stream& stream) {
  for_each("write_points", points.n, stream,
           [to, owners, first = points.first.data(), item_first = items.first.data(),
            item = points.item.data(), lo = points.lo.data(),
            hi = points.hi.data()] __device__(std::uint32_t i) {
             const std::uint32_t owner = owner_of(first, owners, i), at = i - first[owner];
             const auto view = to.view<QuadtreeView<T>>(owner);
             index_detail::writable(view.first)[at] = item[i] - item_first[owner];
             index_detail::writable(view.mins)[at] = value_of<T>(lo[i]);
             index_detail::writable(view.maxs)[at] = value_of<T>(hi[i]);
           });
  for_each("write_ids", items.n, stream,
           [to, first = items.first.data(), order = order.data(), id = items.id.data(),
            owner = items.owner.data()] __device__(std::uint32_t i) {
             const std::uint32_t own = owner[order[i]];
             const auto view = to.view<QuadtreeView<T>>(own);
             index_detail::writable(view.ids)[i - first[own]] = id[order[i]];
           });
}

}  // namespace

template <class T>
IndexBlocks build_quadtree(const RangeBatch<T>& batch, const Stream& stream) {
  const auto items = collect(batch, stream);
  const auto order = z_order(items, batch.owners, kBoundBits<T>, stream);
  const auto points = group_points(items, order, stream);
  std::vector<IndexHeader> headers = batch.headers;
  std::uint64_t nodes = 0;
  Tree<BoundKey<T>> tree;
  if (points.n > 0) {
    tree = make_tree<T>(points, batch.owners, stream);
    const auto counts = count_squares<T>(points, tree, stream);
    for (std::size_t i = 0; i < headers.size(); ++i) nodes += headers[i].nodes = counts[i];
  }
  for (std::size_t i = 0; i < headers.size(); ++i) {
    headers[i].stored = items.host_first[i + 1] - items.host_first[i];
    headers[i].points = points.host_first[i + 1] - points.host_first[i];
  }
  PendingBlocks pending(std::move(headers), stream);
  write_nodes<T>(points, tree, batch.owners, nodes, pending.writer(), stream);
  write_points<T>(items, points, order, batch.owners, pending.writer(), stream);
  return pending.finish(stream);
}

#define ISOBRICK_INSTANTIATE(T) \
  template IndexBlocks build_quadtree<T>(const RangeBatch<T>&, const Stream&);
ISOBRICK_FOR_SAMPLE_TYPES(ISOBRICK_INSTANTIATE)
#undef ISOBRICK_INSTANTIATE

}  // namespace isobrick::gpu
