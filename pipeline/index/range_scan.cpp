#include "pipeline/index/range_scan.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <limits>
#include <optional>

#include <isobrick/error.h>
#include "bricks/ranges/range_format.h"
#include "index/row_ranges.h"

namespace isobrick::inline v0 {
namespace {

/// Bytes of a row that are reduced at a time: its bounds and a few
/// rows stay in the first-level cache.
constexpr std::size_t kRowBytes = 4096;

/// Items along one axis whose ranges see some sample in [lo, hi): a sample on
/// the border of two items belongs to both.
struct Span {
  Index first, last;
};
Span items_seeing(Index lo, Index hi, Index edge) {
  return {lo > 0 ? (lo - 1) / edge : 0, (hi - 1) / edge};
}
/// The samples in [lo, hi) that item `i` sees.
Span samples_seen(Index i, Index lo, Index hi, Index edge) {
  return {std::max(lo, i * edge), std::min(hi, i * edge + edge + 1)};
}

/// A dense box of samples.
template <class T>
struct Samples {
  Box3 box;
  const T* data;
  Index row_stride() const { return box.hi.x - box.lo.x; }
  Index plane_stride() const { return row_stride() * (box.hi.y - box.lo.y); }
  const T* at(Int3 p) const { return data + linear_index(p - box.lo, box.extent()); }
};

/// Merges the samples with y in `ys` and z in `zs` into one row of items, which begins with item
/// `row_begin`. Whether any is NaN.
template <class T>
bool merge_item_row(const Samples<T>& in, Span ys, Span zs, Index edge, Index row_begin,
                    ValueRange<T>* row) {
  const Index items_at_once = std::max<Index>(1, static_cast<Index>(kRowBytes / sizeof(T)) / edge);
  ColumnRanges<T> columns;
  bool has_nan = false;
  const Span all = items_seeing(in.box.lo.x, in.box.hi.x, edge);
  for (Index first = all.first; first <= all.last; first += items_at_once) {
    const Index last = std::min(first + items_at_once - 1, all.last);
    const Index x0 = samples_seen(first, in.box.lo.x, in.box.hi.x, edge).first;
    const Index x1 = samples_seen(last, in.box.lo.x, in.box.hi.x, edge).last;
    columns.reset(x1 - x0);
    has_nan |= columns.add({.first = in.at({x0, ys.first, zs.first}),
                            .width = x1 - x0,
                            .rows = ys.last - ys.first,
                            .planes = zs.last - zs.first,
                            .row_stride = in.row_stride(),
                            .plane_stride = in.plane_stride()});
    for (Index i = first; i <= last; ++i) {
      const Span xs = samples_seen(i, in.box.lo.x, in.box.hi.x, edge);
      row[i - row_begin].include(columns.over(xs.first - x0, xs.last - x0));
    }
  }
  return has_nan;
}

/// Which zero a minimum over -0 and +0 finds depends on the order of the scan;
/// stored ranges must not.
template <class T>
void canonicalise_zeros(std::vector<ValueRange<T>>& ranges) {
  if constexpr (std::numeric_limits<T>::has_quiet_NaN)
    for (ValueRange<T>& r : ranges) {
      r.lo += T{0};
      r.hi += T{0};
    }
}

}  // namespace

template <class T>
RangeScanner<T>::RangeScanner(Box3 part, Int3 edge) : edge_(edge), end_(part.hi.z) {
  for (int axis = 0; axis < 3; ++axis) {
    const Span seen = items_seeing(part.lo[axis], part.hi[axis], edge[axis]);
    items_.lo[axis] = seen.first;
    items_.hi[axis] = seen.last + 1;
  }
  first_open_ = items_.lo.z;
}

template <class T>
typename RangeScanner<T>::Layer& RangeScanner<T>::layer(Index z) {
  const Int3 e = items_.extent();
  while (first_open_ + static_cast<Index>(open_.size()) <= z)
    open_.emplace_back(static_cast<std::size_t>(e.x * e.y));
  return open_[static_cast<std::size_t>(z - first_open_)];
}

template <class T>
void RangeScanner<T>::add(Box3 box, const T* samples) {
  const Samples<T> in{box, samples};
  const Span rows = items_seeing(box.lo.y, box.hi.y, edge_.y);
  const Span layers = items_seeing(box.lo.z, box.hi.z, edge_.z);
  layer(layers.last);  // all exist before the threads start
  const Index row_count = rows.last - rows.first + 1;
  const Index layer_count = layers.last - layers.first + 1;
  std::atomic<bool> found = false;
  tbb::parallel_for(Index{0}, row_count * layer_count, [&](Index task) {
    const Index j = rows.first + task % row_count, k = layers.first + task / row_count;
    Layer& out = open_[static_cast<std::size_t>(k - first_open_)];
    if (merge_item_row(in, samples_seen(j, box.lo.y, box.hi.y, edge_.y),
                       samples_seen(k, box.lo.z, box.hi.z, edge_.z), edge_.x, items_.lo.x,
                       out.data() + (j - items_.lo.y) * items_.extent().x))
      found = true;
  });
  has_nan_ |= found;
}

template <class T>
void RangeScanner<T>::merge(Box3 items, std::span<const ValueRange<T>> ranges) {
  if (items.lo.z < first_open_ || intersect(items, items_) != items)
    throw Error("ranges of a part lie where no more are expected");
  Layer& out = layer(items.lo.z);
  auto from = ranges.begin();
  for (Index y = items.lo.y; y < items.hi.y; ++y) {
    auto to = out.begin() + (y - items_.lo.y) * items_.extent().x + items.lo.x - items_.lo.x;
    for (Index x = items.lo.x; x < items.hi.x; ++x) (to++)->include(*from++);
  }
}

template <class T>
void RangeScanner<T>::close(Index z1, const RangeEmit& emit) {
  const bool all = z1 >= end_;
  // A layer is complete once the first plane of the next one has been merged.
  while (first_open_ < items_.hi.z && (all || (first_open_ + 1) * edge_.z < z1)) {
    Layer& done = layer(first_open_);
    canonicalise_zeros(done);
    const Int3 lo = items_.lo, hi = items_.hi;
    emit({{lo.x, lo.y, first_open_}, {hi.x, hi.y, first_open_ + 1}},
         std::as_bytes(std::span(done)));
    open_.pop_front();
    ++first_open_;
  }
}

template class RangeScanner<std::uint8_t>;
template class RangeScanner<std::int8_t>;
template class RangeScanner<std::uint16_t>;
template class RangeScanner<std::int16_t>;
template class RangeScanner<std::uint32_t>;
template class RangeScanner<std::int32_t>;
template class RangeScanner<float>;
template class RangeScanner<double>;
template class RangeScanner<std::uint64_t>;
template class RangeScanner<std::int64_t>;

namespace {

constexpr Int3 kBlock{kBlockEdge, kBlockEdge, kBlockEdge};

bool whole_blocks(Int3 brick) {
  return brick.x % kBlockEdge == 0 && brick.y % kBlockEdge == 0 && brick.z % kBlockEdge == 0;
}

/// Layers of bricks as the union of the blocks in them: the cells of a brick
/// are the cells of its blocks when its edges are whole numbers of blocks.
template <class T>
class BricksFromBlocks {
 public:
  explicit BricksFromBlocks(const Lattice& lattice)
      : blocks_(lattice.blocks()),
        bricks_(lattice.bricks()),
        // Not used when a brick is smaller than a block.
        ratio_(max(Int3{1, 1, 1}, {lattice.brick.x / kBlockEdge, lattice.brick.y / kBlockEdge,
                                   lattice.brick.z / kBlockEdge})) {}

  void add(Index block_z, std::span<const std::byte> pairs, const RangeEmit& emit) {
    if (layer_.empty()) layer_.resize(static_cast<std::size_t>(bricks_.x * bricks_.y));
    const auto* block = reinterpret_cast<const ValueRange<T>*>(pairs.data());
    for (Index y = 0; y < blocks_.y; ++y) {
      ValueRange<T>* row = layer_.data() + y / ratio_.y * bricks_.x;
      for (Index x = 0; x < blocks_.x; ++x) row[x / ratio_.x].include(*block++);
    }
    if ((block_z + 1) % ratio_.z != 0 && block_z + 1 != blocks_.z) return;
    const Index z = block_z / ratio_.z;
    emit({{0, 0, z}, {bricks_.x, bricks_.y, z + 1}}, std::as_bytes(std::span(layer_)));
    layer_.clear();
  }

 private:
  Int3 blocks_, bricks_, ratio_;
  std::vector<ValueRange<T>> layer_;
};

template <class T>
class TypedLevelRanges final : public LevelRanges {
 public:
  TypedLevelRanges(const Lattice& lattice, Box3 part) : blocks_(part, kBlock) {
    if (!whole_blocks(lattice.brick))
      bricks_.emplace(part, lattice.brick);
    else if (part == lattice.box())
      from_blocks_.emplace(lattice);
  }

  void add(Box3 box, const std::byte* samples) override {
    const T* typed = reinterpret_cast<const T*>(samples);
    blocks_.add(box, typed);
    if (bricks_) bricks_->add(box, typed);
  }

  void close(Index z1, const RangeEmit& blocks, const RangeEmit& bricks) override {
    blocks_.close(z1, [&](Box3 items, std::span<const std::byte> pairs) {
      blocks(items, pairs);
      if (from_blocks_) from_blocks_->add(items.lo.z, pairs, bricks);
    });
    if (bricks_) bricks_->close(z1, bricks);
  }

  bool has_nan() const override { return blocks_.has_nan(); }

  void merge_blocks(Box3 items, std::span<const std::byte> pairs) override {
    blocks_.merge(items, as_ranges(pairs));
  }
  void merge_bricks(Box3 items, std::span<const std::byte> pairs) override {
    if (bricks_) bricks_->merge(items, as_ranges(pairs));
  }

 private:
  static std::span<const ValueRange<T>> as_ranges(std::span<const std::byte> pairs) {
    return {reinterpret_cast<const ValueRange<T>*>(pairs.data()),
            pairs.size() / sizeof(ValueRange<T>)};
  }

  RangeScanner<T> blocks_;
  std::optional<BricksFromBlocks<T>> from_blocks_;
  std::optional<RangeScanner<T>> bricks_;
};

}  // namespace

std::unique_ptr<LevelRanges> make_level_ranges(const Lattice& lattice) {
  return make_part_ranges(lattice, lattice.box());
}

std::unique_ptr<LevelRanges> make_part_ranges(const Lattice& lattice, Box3 part) {
  return visit_sample(lattice.type, [&](auto tag) -> std::unique_ptr<LevelRanges> {
    return std::make_unique<TypedLevelRanges<typename decltype(tag)::type>>(lattice, part);
  });
}

std::size_t level_ranges_bytes(const Lattice& lattice, Index planes) {
  const Int3 blocks = lattice.blocks(), bricks = lattice.bricks();
  const Index open_blocks = std::min(blocks.z, planes / kBlockEdge + 2);
  const Index open_bricks = std::min(bricks.z, planes / lattice.brick.z + 2);
  const Index items = blocks.x * blocks.y * open_blocks + bricks.x * bricks.y * open_bricks;
  return static_cast<std::size_t>(items) * 2 * lattice.sample_bytes();
}

std::size_t gathered_ranges_bytes(const Lattice& lattice) {
  Index items = 0;
  for (const Int3 all : {lattice.blocks(), lattice.bricks()})
    items += all.x * all.y * std::min(all.z, range_chunk_extent(all).z + 2);
  return static_cast<std::size_t>(items) * 2 * lattice.sample_bytes();
}

}  // namespace isobrick
