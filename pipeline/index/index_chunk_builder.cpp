#include "pipeline/index/index_chunk_builder.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <memory>

#include <isobrick/error.h>
#include "bricks/zarr/codec.h"
#include "core/box_union.h"
#include "core/morton.h"
#include "index/leaf_ranges.h"
#include "index/span_index.h"
#include "pipeline/program_memory.h"
#include "pipeline/slab_reader.h"

namespace isobrick::inline v0 {
namespace {

constexpr Index kEdge = IndexLayout::kBrick;
constexpr Index kBrickBlocks = kEdge / kBlockEdge;

/// Making one part: its ranges, what sorting them takes, the index, encoded.
std::uint64_t part_bytes(ScalarType type, Index leaf) {
  const auto edge = static_cast<std::uint64_t>(kEdge / leaf);
  const std::uint64_t size = size_of(type);
  return edge * edge * edge * (2 * size + 4 * (2 * size + 8) + 2 * (24 + 6 * size)) + 65536;
}

std::uint64_t memory_for(const Lattice& lattice, Index leaf, int threads, Index piece,
                         std::uint64_t batch) {
  std::uint64_t bytes = kProgramBytes + batch * part_bytes(lattice.type, leaf);
  if (leaf < kBlockEdge)
    bytes += index_reading_bytes(lattice, threads) + index_piece_bytes(lattice, piece);
  return bytes;
}

}  // namespace

std::uint64_t index_piece_bytes(const Lattice& lattice, Index bricks) {
  const Index samples = bricks * kEdge + 1;
  return static_cast<std::uint64_t>(volume(min({samples, samples, samples}, lattice.extent))) *
         lattice.sample_bytes();
}

std::uint64_t index_reading_bytes(const Lattice& lattice, int threads) {
  return std::min(std::uint64_t{64} << 20,
                  32 * static_cast<std::uint64_t>(volume(lattice.bricks()))) +
         static_cast<std::uint64_t>(threads) * lattice.brick_bytes() * 9 / 4;
}

std::uint64_t IndexChunkBuilder::min_memory(const Lattice& lattice, Index leaf, int threads) {
  return memory_for(lattice, leaf, threads, 1, 1);
}

IndexChunkBuilder::IndexChunkBuilder(const StoreReader& store, int level, const IndexLayout& layout,
                                     IndexKind kind, std::uint64_t memory, int threads,
                                     IndexInput input)
    : store_(store), level_(level), layout_(layout), kind_(kind), input_(input) {
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  const auto fits = [&](Index piece, std::uint64_t batch) {
    return memory_for(lattice, layout.leaf, threads, piece, batch) <= memory;
  };
  std::uint64_t batch = 8 * static_cast<std::uint64_t>(threads);
  while (batch > 1 && !fits(1, batch)) batch /= 2;
  batch_ = static_cast<std::size_t>(batch);
  piece_ = IndexLayout::kChunk;
  while (piece_ > 1 && !fits(piece_, batch)) piece_ /= 2;
}

/// The work on one chunk.
template <class T>
class IndexChunkBuilder::Chunk {
 public:
  Chunk(const IndexChunkBuilder& builder, Int3 c, const Encode& encode, const Take& take)
      : builder_(builder),
        layout_(builder.layout_),
        box_(layout_.bricks_of_chunk(c)),
        encode_(encode),
        take_(take),
        ranges_(static_cast<std::size_t>(volume(box_.extent()))) {
    if (builder.input_ == IndexInput::samples) return;
    const Int3 cell_blocks = ceil_div(layout_.cells(), {kBlockEdge, kBlockEdge, kBlockEdge});
    blocks_ = builder.store_.block_ranges(
        builder.level_,
        intersect({box_.lo * kBrickBlocks, box_.hi * kBrickBlocks}, {{0, 0, 0}, cell_blocks}));
  }

  void run();

 private:
  /// The ranges of the blocks of an index brick, C order of its grid of leaf 16.
  std::vector<ValueRange<T>> block_ranges(Int3 b) const;
  /// All index bricks, in Morton order.
  std::vector<Int3> all_bricks() const;
  ValueRange<T>& range_of(Int3 b) {
    return ranges_[static_cast<std::size_t>(linear_index(b - box_.lo, box_.extent()))];
  }
  void find_ranges();
  bool is_active(Int3 b, std::span<const ValueRange<T>> ranges);
  void write_directory();
  void build_from_blocks(const std::vector<Int3>& bricks);
  void build_from_samples(const std::vector<Int3>& bricks);
  template <class Ranges>
  void write_parts(std::span<const Int3> bricks, const Ranges& ranges_of);

  const IndexChunkBuilder& builder_;
  const IndexLayout& layout_;
  Box3 box_;
  const Encode& encode_;
  const Take& take_;
  RangeTable blocks_;
  std::vector<ValueRange<T>> ranges_;  ///< of the index bricks, C order
};

template <class T>
std::vector<ValueRange<T>> IndexChunkBuilder::Chunk<T>::block_ranges(Int3 b) const {
  const Box3 of_brick =
      intersect({b * kBrickBlocks, (b + Int3{1, 1, 1}) * kBrickBlocks}, blocks_.box);
  std::vector<ValueRange<T>> ranges;
  for_each_point(of_brick, [&](Int3 p) {
    const ValueRange<double>& range = blocks_.at(p);
    ranges.push_back(range.empty()
                         ? ValueRange<T>{}
                         : ValueRange<T>{static_cast<T>(range.lo), static_cast<T>(range.hi)});
  });
  return ranges;
}

template <class T>
std::vector<Int3> IndexChunkBuilder::Chunk<T>::all_bricks() const {
  std::vector<Int3> bricks;
  for_each_morton(box_.extent(), [&](Int3 p) { bricks.push_back(box_.lo + p); });
  return bricks;
}

/// Those of the index bricks, from those of the blocks.
template <class T>
void IndexChunkBuilder::Chunk<T>::find_ranges() {
  for (const Int3 b : all_bricks())
    for (const ValueRange<T>& block : block_ranges(b)) range_of(b).include(block);
}

template <class T>
void IndexChunkBuilder::Chunk<T>::write_directory() {
  take_(IndexLayout::kDirectory, encode_(build_index<T>(builder_.kind_, ranges_, box_.extent())));
}

/// Makes the parts of `bricks`, a batch at a time; ranges_of(brick) are those of its items. Bricks
/// that cannot be active have none.
template <class T>
template <class Ranges>
void IndexChunkBuilder::Chunk<T>::write_parts(std::span<const Int3> bricks,
                                              const Ranges& ranges_of) {
  std::vector<std::vector<std::byte>> parts(std::min(builder_.batch_, bricks.size()));
  for (std::size_t first = 0; first < bricks.size(); first += parts.size()) {
    const std::size_t count = std::min(parts.size(), bricks.size() - first);
    tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
      const Int3 b = bricks[first + i];
      const std::vector<ValueRange<T>> ranges = ranges_of(b);
      if (!is_active(b, ranges)) return parts[i].clear();
      parts[i] = encode_(build_index<T>(builder_.kind_, ranges, layout_.leaves_of_brick(b)));
    });
    for (std::size_t i = 0; i < count; ++i)
      if (!parts[i].empty()) take_(layout_.part_of_brick(bricks[first + i]), std::move(parts[i]));
  }
}

/// Whether an isovalue stabs a brick of these ranges. Where they are the first that is known of it,
/// they become that of the brick.
template <class T>
bool IndexChunkBuilder::Chunk<T>::is_active(Int3 b, std::span<const ValueRange<T>> ranges) {
  ValueRange<T>& of_brick = range_of(b);
  if (builder_.input_ == IndexInput::samples)
    for (const ValueRange<T>& range : ranges) of_brick.include(range);
  return of_brick.lo < of_brick.hi;
}

template <class T>
void IndexChunkBuilder::Chunk<T>::build_from_blocks(const std::vector<Int3>& bricks) {
  write_parts(bricks, [&](Int3 b) { return block_ranges(b); });
}

template <class T>
void IndexChunkBuilder::Chunk<T>::build_from_samples(const std::vector<Int3>& bricks) {
  const Box3 volume_box{{0, 0, 0}, layout_.extent};
  std::unique_ptr<std::byte[]> samples;
  std::size_t room = 0;
  const auto piece_of = [&](Int3 b) {
    return Int3{b.x / builder_.piece_, b.y / builder_.piece_, b.z / builder_.piece_};
  };
  for (std::size_t first = 0, end = 0; first < bricks.size(); first = end) {
    // In Morton order the bricks of a piece, a cube of a power of two, follow each other.
    Box3 box;
    for (end = first; end < bricks.size() && piece_of(bricks[end]) == piece_of(bricks[first]);
         ++end)
      box = unite(box, {bricks[end], bricks[end] + Int3{1, 1, 1}});
    const Box3 seen = intersect({box.lo * kEdge, box.hi * kEdge + Int3{1, 1, 1}}, volume_box);
    const Int3 extent = seen.extent();
    const auto bytes = static_cast<std::size_t>(volume(extent)) * sizeof(T);
    if (bytes > room) {
      samples.reset();
      samples = std::make_unique_for_overwrite<std::byte[]>(room = bytes);
    }
    read_slab(builder_.store_, builder_.level_, seen, samples.get(), nullptr,
              builder_.input_ == IndexInput::samples ? BrickChecksum([](Int3, std::uint32_t) {})
                                                     : nullptr);
    const T* typed = reinterpret_cast<const T*>(samples.get());
    write_parts(std::span(bricks).subspan(first, end - first), [&](Int3 b) {
      const Box3 of_brick =
          intersect({b * kEdge, (b + Int3{1, 1, 1}) * kEdge + Int3{1, 1, 1}}, volume_box);
      std::vector<ValueRange<T>> ranges;
      leaf_ranges<T>({typed + linear_index(of_brick.lo - seen.lo, extent), of_brick.extent(),
                      extent.x, extent.x * extent.y},
                     layout_.leaf, ranges);
      return ranges;
    });
  }
}

template <class T>
void IndexChunkBuilder::Chunk<T>::run() {
  if (builder_.input_ == IndexInput::samples) {
    build_from_samples(all_bricks());
    write_directory();
    return;
  }
  find_ranges();
  write_directory();
  std::vector<Int3> bricks = all_bricks();
  std::erase_if(bricks, [&](Int3 b) { return !(range_of(b).lo < range_of(b).hi); });
  if (layout_.leaf == kBlockEdge)
    build_from_blocks(bricks);
  else
    build_from_samples(bricks);
}

void IndexChunkBuilder::build(Int3 chunk, const Encode& encode, const Take& take) const {
  visit_scalar(layout_.type, [&](auto tag) {
    Chunk<typename decltype(tag)::type>(*this, chunk, encode, take).run();
  });
}

MakeIndexParts span_index_parts(const StoreReader& store, int level, const IndexLayout& layout,
                                IndexKind kind, std::uint64_t memory, int threads,
                                IndexInput input) {
  const auto builder =
      std::make_shared<IndexChunkBuilder>(store, level, layout, kind, memory, threads, input);
  return [builder](Int3 c, const EncodeIndexPart& encode, const TakeIndexPart& take) {
    builder->build(c, encode, take);
  };
}

}  // namespace isobrick
