#pragma once

#include <cstdint>
#include <cstring>

#include "core/partition_point.h"
#include "gpu/search/span_kernels.h"
#include "index/span_index.h"

// How warps search the arrays of an index together. Each structure is cut into
// as many parts as there are warps, so that no warp waits for another one and
// none has a list of what is still to be visited; docs/design/search.md has the picture.

namespace isobrick::inline v0::gpu {

/// The warps that search one index together, and which of them this is. All 32
/// threads of a warp walk alike and share the items that they report.
struct Crew {
  std::uint32_t warp, warps, lane;
};

/// Sets the bits of stabbed items.
struct Marker {
  std::uint32_t* words;
  RunQueue later;  ///< without room where every warp marks what it finds

  __device__ void item(std::uint32_t id) const { atomicOr(words + (id >> 5), 1u << (id & 31)); }

  /// n ids that lie one after the other; all threads of the warp.
  __device__ void list(const Crew& crew, const std::uint32_t* ids, std::uint32_t n) const {
    for (std::uint64_t i = crew.lane; i < n; i += 32) item(ids[i]);
  }

  /// The same, but a list that is long for one warp is left to all of them.
  __device__ void shared_list(const Crew& crew, const std::uint32_t* ids, std::uint32_t n) const {
    if (later.room == 0 || n <= RunQueue::kRun) return list(crew, ids, n);
    const std::uint32_t runs = (n - 1) / RunQueue::kRun + 1;
    std::uint32_t place = 0;
    if (crew.lane == 0) place = atomicAdd(later.count, runs);
    place = __shfl_sync(0xffffffffu, place, 0);
    for (std::uint32_t i = crew.lane; i < runs; i += 32) {
      const std::uint32_t begin = i * RunQueue::kRun;
      const Run run{ids + begin, ::min(n - begin, RunQueue::kRun)};
      if (place + i < later.room)
        later.runs[place + i] = run;
      else
        for (std::uint32_t j = 0; j < run.n; ++j) item(run.ids[j]);
    }
  }
};

/// What the threads of a block share in a walk, by structure: nothing, the path of
/// an interval tree's query (a prefix of a list at each node), an octree's nodes
/// that are still to be looked at (of two levels, for each warp).
template <class View>
struct WalkShared {};

template <class T>
struct WalkShared<IntervalView<T>> {
  Run path[32];
};

template <class T>
struct WalkShared<OctreeView<T>> {
  static constexpr std::uint32_t kNodes = 512;
  std::uint32_t nodes[kSearchThreads / 32][2][kNodes];
};

// ---- linear scan ----

/// Bit j: item first + j of a thread's 8 bytes of minima and of maxima is stabbed.
template <class T>
__device__ std::uint32_t stabbed_bits(const LinearView<T>& view, std::uint64_t first, T value) {
  constexpr int kEach = 8 / sizeof(T);
  std::uint32_t bits = 0;
  if (first + kEach <= view.items) {
    T lo[kEach], hi[kEach];
    const auto a = *reinterpret_cast<const unsigned long long*>(view.mins + first);
    const auto b = *reinterpret_cast<const unsigned long long*>(view.maxs + first);
    memcpy(lo, &a, sizeof a);
    memcpy(hi, &b, sizeof b);
#pragma unroll
    for (int j = 0; j < kEach; ++j)
      bits |= static_cast<std::uint32_t>(lo[j] < value && value <= hi[j]) << j;
  } else {
    for (std::uint64_t i = first; i < view.items; ++i)
      bits |= static_cast<std::uint32_t>(view.mins[i] < value && value <= view.maxs[i])
              << (i - first);
  }
  return bits;
}

/// Threads that have bits of one word put them together.
template <class T>
__device__ void walk(const LinearView<T>& view, T value, const Marker& mark, const Crew& crew,
                     WalkShared<LinearView<T>>&) {
  constexpr std::uint32_t kEach = 8 / sizeof(T), kThreadsOfWord = 32 / kEach;
#pragma unroll 2
  for (std::uint64_t begin = 32ull * kEach * crew.warp; begin < view.items;
       begin += 32ull * kEach * crew.warps) {
    const std::uint64_t first = begin + kEach * crew.lane;
    std::uint32_t word = first < view.items ? stabbed_bits(view, first, value) << (first & 31) : 0;
#pragma unroll
    for (std::uint32_t d = 1; d < kThreadsOfWord; d *= 2)
      word |= __shfl_xor_sync(0xffffffffu, word, d);
    if (crew.lane % kThreadsOfWord == 0 && word != 0) mark.words[first >> 5] = word;
  }
}

// ---- interval tree ----

/// The prefix of a node's list that is stabbed.
template <class T>
__device__ Run prefix_of(const IntervalView<T>& view, std::uint32_t node, T value) {
  const T split = view.splits[node];
  const std::uint32_t first = view.first[node], n = view.first[node + 1] - first;
  const bool below = value < split, above = split < value;
  if (!below && !above) return {view.by_min + first, n};
  const std::uint32_t stabbed = partition_point(n, [&](std::uint32_t i) {
    return below ? view.mins[first + i] < value : value <= view.maxs[first + i];
  });
  return {(above ? view.by_max : view.by_min) + first, stabbed};
}

/// One path from the root. Each thread of a block's first warp keeps a node of
/// it, so that all prefixes are measured at once; then all warps copy them.
template <class T>
__device__ void walk(const IntervalView<T>& view, T value, const Marker& mark, const Crew& crew,
                     WalkShared<IntervalView<T>>& shared) {
  __syncthreads();  // the path of a search before this one has been read
  if (threadIdx.x < 32) {
    std::uint32_t base = 0, depth = 0, own = view.nodes;
    for (std::uint32_t step = index_detail::largest_power(view.nodes); step; step /= 2, ++depth) {
      const std::uint32_t node = base + step - 1;
      if (node >= view.nodes) continue;
      if (depth == crew.lane) own = node;
      const T split = view.splits[node];
      if (split < value)
        base += step;
      else if (!(value < split))
        break;  // whatever lies below ends before the split or begins at it
    }
    shared.path[crew.lane] = own < view.nodes ? prefix_of(view, own, value) : Run{nullptr, 0};
  }
  __syncthreads();
  for (std::uint32_t i = 0; i < 32; ++i) {
    const Run run = shared.path[i];
    // Another warp begins each list: most are short.
    const std::uint32_t turn = (crew.warp + i) % crew.warps;
    for (std::uint64_t at = 32ull * turn + crew.lane; at < run.n; at += 32ull * crew.warps)
      mark.item(run.ids[at]);
  }
}

// ---- k-d tree ----

template <class T>
__device__ void report_part(const KdView<T>& view, const index_detail::KdPart& part, T value,
                            const Marker& mark, const Crew& crew) {
  if (part.begin >= part.end) return;
  if (part.min_holds && part.max_holds)
    return mark.list(crew, view.ids + part.begin, part.end - part.begin);
  // At most KdView::kBucket items: a thread each.
  const std::uint32_t i = part.begin + crew.lane;
  if (i < part.end && view.mins[i] < value && value <= view.maxs[i]) mark.item(view.ids[i]);
}

/// A part with its middle item, and how it is divided.
template <class T>
struct KdDivision {
  std::uint32_t middle;
  bool min_holds, max_holds;  ///< true of the middle item
  index_detail::KdPart lower, upper;
  bool lower_lives, upper_lives;  ///< whether an item of it can be stabbed

  __device__ KdDivision(const KdView<T>& view, const index_detail::KdPart& part, T value)
      : middle(part.begin + (part.end - part.begin) / 2),
        min_holds(view.mins[middle] < value),
        max_holds(value <= view.maxs[middle]),
        lower{part.begin, middle, !part.by_max, part.min_holds, part.max_holds},
        upper{middle + 1, part.end, !part.by_max, part.min_holds, part.max_holds},
        lower_lives(!part.by_max || max_holds),
        upper_lives(part.by_max || min_holds) {
    if (part.by_max)
      upper.max_holds |= max_holds;
    else
      lower.min_holds |= min_holds;
  }
};

template <class T>
__device__ void walk_part(const KdView<T>& view, index_detail::KdPart part, T value,
                          const Marker& mark, const Crew& crew) {
  using index_detail::KdPart;
  // Of each divided part at most one half waits, and halves shrink by two.
  KdPart waiting[KdView<T>::kMaxDepth + 1];
  int depth = 0;
  for (;;) {
    while (part.end - part.begin > KdView<T>::kBucket && !(part.min_holds && part.max_holds)) {
      const KdDivision<T> d(view, part, value);
      if (d.min_holds && d.max_holds && crew.lane == 0) mark.item(view.ids[d.middle]);
      const bool by_max = part.by_max;
      part = by_max ? d.upper : d.lower;
      if (by_max ? d.lower_lives : d.upper_lives) waiting[depth++] = by_max ? d.lower : d.upper;
    }
    report_part(view, part, value, mark, crew);
    if (depth == 0) return;
    part = waiting[--depth];
  }
}

/// Goes down to a part of the tree, by the bits of its number, as long as an item
/// of it can be stabbed, and searches it. Of the parts below a middle item the
/// first one reports that.
template <class T>
__device__ void walk_subtree(const KdView<T>& view, std::uint32_t number, int depth, T value,
                             const Marker& mark, const Crew& crew) {
  index_detail::KdPart part{0, view.stored, false, false, false};
  while (--depth >= 0) {
    const std::uint32_t left = number & ((2u << depth) - 1);
    if (part.end - part.begin <= KdView<T>::kBucket) {
      if (left != 0) return;
      break;
    }
    const KdDivision<T> d(view, part, value);
    if (left == 0 && d.min_holds && d.max_holds && crew.lane == 0) mark.item(view.ids[d.middle]);
    const bool upper = number >> depth & 1u;
    if (!(upper ? d.upper_lives : d.lower_lives)) return;
    part = upper ? d.upper : d.lower;
  }
  walk_part(view, part, value, mark, crew);
}

template <class T>
__device__ void walk(const KdView<T>& view, T value, const Marker& mark, const Crew& crew,
                     WalkShared<KdView<T>>&) {
  int depth = 0;
  while (1u << depth < crew.warps && view.stored >> depth > 4 * KdView<T>::kBucket) ++depth;
  for (std::uint32_t i = crew.warp; i < 1u << depth; i += crew.warps)
    walk_subtree(view, i, depth, value, mark, crew);
}

// ---- quadtree ----

template <class T>
__device__ bool can_stab(const QuadNode<T>& node, T value) {
  return node.min_lo < value && value <= node.max_hi;
}

/// Points of a node that is not divided.
template <class T>
__device__ void report_points(const QuadtreeView<T>& view, std::uint32_t begin, std::uint32_t end,
                              T value, const Marker& mark, const Crew& crew) {
  for (; begin < end; begin += 32) {
    const std::uint32_t p = begin + crew.lane;
    const bool stabbed = p < end && view.mins[p] < value && value <= view.maxs[p];
    for (std::uint32_t left = __ballot_sync(0xffffffffu, stabbed); left; left &= left - 1) {
      const std::uint32_t q = begin + static_cast<std::uint32_t>(__ffs(static_cast<int>(left))) - 1;
      mark.shared_list(crew, view.ids + view.first[q], view.first[q + 1] - view.first[q]);
    }
  }
}

/// Nodes lie before their descendants and points in their order: a walk may begin
/// at any node, and what it reports is cut off where the next walk's points begin.
template <class T>
__device__ void walk_nodes(const QuadtreeView<T>& view, std::uint32_t begin, std::uint32_t end,
                           T value, const Marker& mark, const Crew& crew) {
  const std::uint32_t last_point = view.node[end].point;
  for (std::uint32_t i = begin; i < end;) {
    const QuadNode<T> node = view.node[i];
    const bool leaf = node.skip == i + 1;
    if (!can_stab(node, value)) {
      i = node.skip;
    } else if (node.min_hi < value && value <= node.max_lo) {
      const std::uint32_t to = ::min(view.node[node.skip].point, last_point);
      const std::uint32_t first = view.first[node.point];
      if (node.point < to) mark.shared_list(crew, view.ids + first, view.first[to] - first);
      i = node.skip;
    } else {
      if (leaf) report_points(view, node.point, view.node[i + 1].point, value, mark, crew);
      ++i;
    }
  }
}

template <class T>
__device__ void walk(const QuadtreeView<T>& view, T value, const Marker& mark, const Crew& crew,
                     WalkShared<QuadtreeView<T>>&) {
  const std::uint64_t each = (std::uint64_t{view.nodes} + crew.warps - 1) / crew.warps;
  const std::uint64_t begin = each * crew.warp;
  if (begin < view.nodes)
    walk_nodes(view, static_cast<std::uint32_t>(begin),
               static_cast<std::uint32_t>(::min(begin + each, std::uint64_t{view.nodes})), value,
               mark, crew);
}

// ---- octree ----

/// The level at whose nodes warps begin: high enough to leave much out, low enough
/// to keep all warps busy, and so that what lies below a node fits WalkShared.
template <class T>
__device__ int starting_level(const OctreeView<T>& view, const Crew& crew) {
  const auto nodes = [&](int level) {
    return view.pyramid[level + 1].first - view.pyramid[level].first;
  };
  int level = 1;
  for (; level + 1 < view.levels && nodes(level) > 4ull * crew.warps; ++level) {
    std::uint64_t below = 1;
    for (int axis = 0; axis < 3; ++axis)
      below *= ::min(std::uint64_t{1} << level, std::uint64_t{view.pyramid[1].extent[axis]});
    if (below > WalkShared<OctreeView<T>>::kNodes) break;
  }
  return level;
}

/// Searches what lies below a node of `level` that is stabbed, level by level.
/// Nodes are noted by their places below it: 10 bits an axis.
template <class T>
__device__ void walk_below(const OctreeView<T>& view, int level, const std::uint32_t (&at)[3],
                           T value, const Marker& mark, const Crew& crew,
                           WalkShared<OctreeView<T>>& shared) {
  auto& queues = shared.nodes[threadIdx.x / 32];
  std::uint32_t count = 1;
  int turn = 0;
  __syncwarp();
  if (crew.lane == 0) queues[0][0] = 0;
  __syncwarp();
  for (int down = 1; level-- > 0; ++down, turn ^= 1) {
    const auto& grid = view.pyramid[level];
    std::uint32_t found = 0;
    for (std::uint32_t first = 0; first < 8 * count; first += 32) {
      const std::uint32_t task = first + crew.lane;
      std::uint32_t place = 0;
      std::uint64_t index = 0;
      bool hit = task < 8 * count;
      if (hit) {
        const std::uint32_t parent = queues[turn][task >> 3];
        // No carry from axis to axis: places have 9 bits before they are doubled.
        place = parent << 1 | (task & 1u) | (task >> 1 & 1u) << 10 | (task >> 2 & 1u) << 20;
        const std::uint64_t x = (std::uint64_t{at[0]} << down) + (place & 1023u),
                            y = (std::uint64_t{at[1]} << down) + (place >> 10 & 1023u),
                            z = (std::uint64_t{at[2]} << down) + (place >> 20);
        hit = x < grid.extent[0] && y < grid.extent[1] && z < grid.extent[2];
        index = (z * grid.extent[1] + y) * grid.extent[0] + x;
      }
      if (hit) hit = index_detail::stabs(view.ranges[grid.first + index], value);
      if (level == 0) {
        if (hit) mark.item(static_cast<std::uint32_t>(index));
        continue;
      }
      const std::uint32_t hits = __ballot_sync(0xffffffffu, hit);
      if (hit) queues[turn ^ 1][found + __popc(hits & ((1u << crew.lane) - 1))] = place;
      found += __popc(hits);
    }
    count = found;
    __syncwarp();
  }
}

template <class T>
__device__ void walk(const OctreeView<T>& view, T value, const Marker& mark, const Crew& crew,
                     WalkShared<OctreeView<T>>& shared) {
  if (view.levels == 0) return;
  if (view.levels == 1) {
    if (crew.warp == 0 && crew.lane == 0 && index_detail::stabs(view.ranges[0], value))
      mark.item(0);
    return;
  }
  const int level = starting_level(view, crew);
  const auto& grid = view.pyramid[level];
  const std::uint64_t nodes = view.pyramid[level + 1].first - grid.first;
  // As many nodes as threads are tested at a time where there are many.
  const std::uint32_t each =
      static_cast<std::uint32_t>(::min((nodes + crew.warps - 1) / crew.warps, std::uint64_t{32}));
  for (std::uint64_t first = std::uint64_t{each} * crew.warp; first < nodes;
       first += std::uint64_t{each} * crew.warps) {
    const std::uint64_t i = first + crew.lane;
    const bool stabbed =
        crew.lane < each && i < nodes && index_detail::stabs(view.ranges[grid.first + i], value);
    for (std::uint32_t left = __ballot_sync(0xffffffffu, stabbed); left; left &= left - 1) {
      const std::uint64_t n = first + static_cast<std::uint32_t>(__ffs(static_cast<int>(left))) - 1;
      const std::uint32_t at[3] = {static_cast<std::uint32_t>(n % grid.extent[0]),
                                   static_cast<std::uint32_t>(n / grid.extent[0] % grid.extent[1]),
                                   static_cast<std::uint32_t>(n / grid.extent[0] / grid.extent[1])};
      walk_below(view, level, at, value, mark, crew, shared);
    }
  }
}

}  // namespace isobrick::gpu
