#include "pipeline/convert/sparse_ranges.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <utility>

#include <isobrick/range.h>
#include <isobrick/range_table.h>
#include "bricks/ranges/brick_checksums.h"
#include "pipeline/index/range_scan.h"

namespace isobrick::inline v0 {
namespace {

constexpr Int3 kBlockExtent{kBlockEdge, kBlockEdge, kBlockEdge};
/// A chunk of ranges, in blocks and in samples.
constexpr Index kChunkBlocks = kRangeChunkEdge;
constexpr Index kChunkSamples = kChunkBlocks * kBlockEdge;
constexpr Int3 kChunk{kChunkBlocks, kChunkBlocks, kChunkBlocks};

template <class T>
class TypedSparseRanges final : public SparseRanges {
 public:
  TypedSparseRanges(StoreWriter& store, int level, const Lattice& lattice,
                    const SampleValue& fill_value, BrickTest is_there)
      : store_(store),
        level_(level),
        lattice_(lattice),
        chunks_(ceil_div(lattice.blocks(), kChunk)),
        is_there_(std::move(is_there)) {
    // Which zero a range keeps must not depend on where a sample lay.
    fill_.include(fill_value.as<T>());
    if (!fill_.empty()) fill_ = {static_cast<T>(fill_.lo + T{0}), static_cast<T>(fill_.hi + T{0})};
  }

  void add(const BrickBlocks& brick) override {
    const auto* pairs = reinterpret_cast<const ValueRange<T>*>(brick.pairs.data());
    for_each_point(brick.blocks, [&](Int3 block) {
      const Int3 chunk = floor_div(block, kChunk);
      auto& ranges = open_[{chunk.z, chunk.y, chunk.x}];
      if (ranges.empty()) ranges.resize(kChunkBlocks * kChunkBlocks * kChunkBlocks);
      const Int3 inside = block - chunk * kChunkBlocks;
      ranges[static_cast<std::size_t>(linear_index(inside, kChunk))].include(*pairs++);
    });
  }

  void close(Index z1) override {
    const bool all = z1 >= lattice_.extent.z;
    // The last blocks of a layer see the first plane of the next one.
    for (; next_ < chunks_.z && (all || (next_ + 1) * kChunkSamples < z1); ++next_) {
      tbb::parallel_for(Index{0}, chunks_.x * chunks_.y, [&](Index i) {
        const Int3 chunk{i % chunks_.x, i / chunks_.x, next_};
        const auto found = open_.find({chunk.z, chunk.y, chunk.x});
        put(chunk, found == open_.end() ? nullptr : &found->second);
      });
      open_.erase(open_.begin(), open_.lower_bound({next_ + 1, 0, 0}));
    }
  }

 private:
  using Ranges = std::vector<ValueRange<T>>;

  /// Writes a chunk's blocks and the bricks that they make up.
  void put(Int3 chunk, const Ranges* seen) {
    const Int3 first = chunk * kChunkBlocks;
    const Box3 blocks = intersect({first, first + kChunk}, {{0, 0, 0}, lattice_.blocks()});
    const Box3 bricks = lattice_.bricks_of(
        {blocks.lo * kBlockExtent, min(blocks.hi * kBlockExtent, lattice_.extent)});
    Ranges of_blocks(static_cast<std::size_t>(volume(blocks.extent())), fill_);
    Ranges of_bricks(static_cast<std::size_t>(volume(bricks.extent())),
                     seen == nullptr ? fill_ : ValueRange<T>{});
    if (seen != nullptr) {
      auto* out = of_blocks.data();
      for_each_point(blocks, [&](Int3 block) {
        ValueRange<T> range =
            (*seen)[static_cast<std::size_t>(linear_index(block - first, kChunk))];
        if (sees_fill(block)) range.include(fill_);
        *out++ = range;
        const Int3 brick = lattice_.brick_of(block * kBlockExtent) - bricks.lo;
        of_bricks[static_cast<std::size_t>(linear_index(brick, bricks.extent()))].include(range);
      });
    }
    store_.put_block_ranges(level_, blocks, std::as_bytes(std::span(of_blocks)));
    store_.put_brick_ranges(level_, bricks, std::as_bytes(std::span(of_bricks)));
  }

  /// Whether any of the bricks that a block's cells touch is not there.
  bool sees_fill(Int3 block) const {
    const Int3 first = block * kBlockExtent;
    const Box3 seen = intersect({first, first + kBlockExtent + Int3{1, 1, 1}}, lattice_.box());
    bool fill = false;
    for_each_point(lattice_.bricks_of(seen), [&](Int3 brick) { fill = fill || !is_there_(brick); });
    return fill;
  }

  StoreWriter& store_;
  int level_;
  Lattice lattice_;
  Int3 chunks_;
  BrickTest is_there_;
  ValueRange<T> fill_;
  std::map<std::array<Index, 3>, Ranges> open_;  ///< by z, y, x of the chunk
  Index next_ = 0;
};

}  // namespace

BrickBlocks scan_brick(const Lattice& lattice, Box3 box, const std::byte* samples) {
  // A lattice of its own, which begins one block below the brick.
  const Int3 origin = max(box.lo - kBlockExtent, {0, 0, 0});
  const Lattice local{box.hi - origin, lattice.brick, lattice.type};
  const auto ranges = make_level_ranges(local);
  ranges->add({box.lo - origin, box.hi - origin}, samples);
  BrickBlocks result;
  const Int3 first = floor_div(origin, kBlockExtent);
  result.blocks = {first, first + local.blocks()};
  ranges->close(
      local.extent.z,
      [&](Box3, std::span<const std::byte> pairs) {
        result.pairs.insert(result.pairs.end(), pairs.begin(), pairs.end());
      },
      [](Box3, std::span<const std::byte>) {});
  result.has_nan = ranges->has_nan();
  return result;
}

BrickBlocks constant_brick(const Lattice& lattice, Box3 box, std::uint64_t bits) {
  return visit_sample(lattice.type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    T value;
    std::memcpy(&value, &bits, sizeof value);
    ValueRange<T> range;
    range.include(static_cast<T>(value + T{0}));  // -0 is 0 in a range
    BrickBlocks result;
    result.blocks = {floor_div(max(box.lo - kBlockExtent, {0, 0, 0}), kBlockExtent),
                     ceil_div(box.hi, kBlockExtent)};
    const std::vector<ValueRange<T>> ranges(
        static_cast<std::size_t>(volume(result.blocks.extent())), range);
    const auto bytes = std::as_bytes(std::span(ranges));
    result.pairs.assign(bytes.begin(), bytes.end());
    result.has_nan = value != value;
    return result;
  });
}

bool sparse_ranges_possible(const Lattice& lattice) {
  bool possible = true;
  for (int axis = 0; axis < 3; ++axis)
    possible &= lattice.brick[axis] % kBlockEdge == 0 && kChunkSamples % lattice.brick[axis] == 0;
  return possible;
}

std::size_t sparse_ranges_bytes(const LevelInfo& level, std::span<const Int3> bricks, int threads) {
  const Lattice& lattice = level.lattice;
  const Int3 chunks = ceil_div(lattice.blocks(), kChunk);
  const Int3 samples = kChunk * kBlockExtent;
  std::vector<bool> touched(static_cast<std::size_t>(volume(chunks)));
  std::vector<std::size_t> of_layer(static_cast<std::size_t>(chunks.z) + 1);
  for (const Int3 b : bricks) {
    const Box3 box = lattice.brick_box(b);
    const Int3 first = floor_div(max(box.lo - kBlockExtent, {0, 0, 0}), samples);
    for_each_point({first, ceil_div(box.hi, samples)}, [&](Int3 chunk) {
      auto seen = touched[static_cast<std::size_t>(linear_index(chunk, chunks))];
      of_layer[static_cast<std::size_t>(chunk.z)] += !seen;
      seen = true;
    });
  }
  // A layer waits for the first bricks of the next one.
  std::size_t open = of_layer[0];
  for (std::size_t z = 0; z + 1 < of_layer.size(); ++z)
    open = std::max(open, of_layer[z] + of_layer[z + 1]);
  // What a thread makes of a chunk: ranges of blocks and of bricks, as the writer takes them
  // and as they are encoded. The writer gathers a layer of chunks of bricks.
  const auto written = 4 * static_cast<std::size_t>(threads);
  const Int3 of_bricks = ceil_div(lattice.bricks(), kChunk);
  const auto gathered = static_cast<std::size_t>(of_bricks.x * of_bricks.y);
  return brick_checksum_bytes(level) + (open + written + gathered) *
                                           static_cast<std::size_t>(volume(kChunk)) * 2 *
                                           lattice.sample_bytes();
}

std::unique_ptr<SparseRanges> make_sparse_ranges(StoreWriter& store, int level,
                                                 const Lattice& lattice,
                                                 const SampleValue& fill_value,
                                                 BrickTest is_there) {
  return visit_sample(lattice.type, [&](auto tag) -> std::unique_ptr<SparseRanges> {
    return std::make_unique<TypedSparseRanges<typename decltype(tag)::type>>(
        store, level, lattice, fill_value, std::move(is_there));
  });
}

}  // namespace isobrick
