#include "pipeline/index/label_chunk_builder.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "core/box_union.h"
#include "core/morton.h"
#include "pipeline/index/level_index.h"
#include "pipeline/program_memory.h"
#include "pipeline/slab_reader.h"
#include "surface/labels/label_key.h"
#include "surface/labels/label_value.h"

namespace isobrick::inline v0 {
namespace {

constexpr Index kListedBrick = IndexLayout::kBrick;
constexpr Index kListedBlocks = kListedBrick / kBlockEdge;

/// The lists of a chunk in memory and packed, and those of the bricks under way.
constexpr std::uint64_t kLabelListBytes =
    4 * max_label_list_bytes(IndexLayout::kChunk * IndexLayout::kChunk * IndexLayout::kChunk);

/// With pieces of so many index bricks along each edge.
std::uint64_t memory_for(const Lattice& lattice, int threads, Index piece) {
  return kProgramBytes + kLabelListBytes + index_reading_bytes(lattice, threads) +
         index_piece_bytes(lattice, piece);
}

/// Samples of a box, dense in C order.
struct ReadBox {
  const std::byte* samples;
  Box3 box;
};

template <class T>
LabelList labels_in(const ReadBox& from, Box3 box) {
  LabelList list;
  FlatMap<char, LabelKey> seen;
  std::optional<T> last;
  const T* typed = reinterpret_cast<const T*>(from.samples);
  for (Index z = box.lo.z; z < box.hi.z; ++z)
    for (Index y = box.lo.y; y < box.hi.y; ++y) {
      const T* row = typed + linear_index(Int3{box.lo.x, y, z} - from.box.lo, from.box.extent());
      for (Index x = 0; x < box.hi.x - box.lo.x; ++x) {
        if (!has_label(row[x]) || row[x] == last) continue;
        last = row[x];
        const Label label = label_of(row[x]);
        if (!seen.insert(label_key(label)).second) continue;
        if (list.labels.size() == LabelList::kMaxLabels) return {{}, true};
        list.labels.push_back(static_cast<std::int64_t>(label.bits()));
      }
    }
  std::sort(list.labels.begin(), list.labels.end());
  return list;
}

LabelList labels_in(ScalarType type, const ReadBox& from, Box3 box) {
  return visit_sample(type,
                      [&](auto tag) { return labels_in<typename decltype(tag)::type>(from, box); });
}

}  // namespace

IndexLayout label_index_layout(const StoreReader& store, int level) {
  return index_layout(store, level, kLabelIndex, kLabelLeaf);
}

std::uint64_t LabelChunkBuilder::min_memory(const Lattice& lattice, int threads) {
  return memory_for(lattice, threads, 1);
}

LabelChunkBuilder::LabelChunkBuilder(const StoreReader& store, int level, const IndexLayout& layout,
                                     std::uint64_t memory, int threads)
    : store_(store.native()), level_(level), layout_(layout) {
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  piece_ = IndexLayout::kChunk;
  while (piece_ > 1 && memory_for(lattice, threads, piece_) > memory) piece_ /= 2;
}

/// The work on one chunk.
class LabelChunkBuilder::Chunk {
 public:
  Chunk(const LabelChunkBuilder& builder, Int3 chunk, const EncodeIndexPart& encode,
        const TakeIndexPart& take)
      : builder_(builder),
        layout_(builder.layout_),
        box_(layout_.bricks_of_chunk(chunk)),
        encode_(encode),
        take_(take),
        lists_(static_cast<std::size_t>(volume(box_.extent()))) {}

  void run() {
    std::vector<Int3> bricks;
    for_each_morton(box_.extent(), [&](Int3 p) { bricks.push_back(box_.lo + p); });
    std::erase_if(bricks, [&](Int3 b) { return has_one_value(b); });
    const auto piece_of = [&](Int3 b) {
      return Int3{b.x / builder_.piece_, b.y / builder_.piece_, b.z / builder_.piece_};
    };
    for (std::size_t first = 0, end = 0; first < bricks.size(); first = end) {
      // In Morton order the bricks of a piece, a cube of a power of two, follow each other.
      for (end = first; end < bricks.size() && piece_of(bricks[end]) == piece_of(bricks[first]);)
        ++end;
      add(std::span(bricks).subspan(first, end - first));
    }
    take_(IndexLayout::kDirectory, encode_(pack_label_lists(lists_)));
  }

 private:
  Box3 samples_of(Box3 cells) const {
    return intersect({cells.lo, cells.hi + Int3{1, 1, 1}}, {{0, 0, 0}, layout_.extent});
  }
  LabelList& list_of(Int3 b) {
    return lists_[static_cast<std::size_t>(linear_index(b - box_.lo, box_.extent()))];
  }
  /// Whether a brick's labels follow from its range; then its list is made.
  bool has_one_value(Int3 b);
  /// Reads bricks of a piece and makes their lists and parts.
  void add(std::span<const Int3> bricks);
  std::vector<LabelList> tile_lists(Int3 b, const ReadBox& from) const;

  const LabelChunkBuilder& builder_;
  const IndexLayout& layout_;
  Box3 box_;
  const EncodeIndexPart& encode_;
  const TakeIndexPart& take_;
  std::vector<LabelList> lists_;  ///< of the index bricks, C order
  std::vector<std::byte> samples_;
};

bool LabelChunkBuilder::Chunk::has_one_value(Int3 b) {
  const Int3 blocks = ceil_div(layout_.cells(), {kBlockEdge, kBlockEdge, kBlockEdge});
  const RangeTable table = builder_.store_.block_ranges(
      builder_.level_,
      intersect({b * kListedBlocks, (b + Int3{1, 1, 1}) * kListedBlocks}, {{0, 0, 0}, blocks}));
  ValueRange<double> all;
  for_each_point(table.box, [&](Int3 p) { all.include(table.at(p)); });
  if (all.lo != all.hi) return false;
  // Of 64-bit integers the ends may be rounded, so that several labels look like one.
  constexpr double first_rounded = 0x1p53;
  if (is_wide_integer(builder_.store_.info().type) && std::abs(all.lo) >= first_rounded)
    return false;
  list_of(b).labels = {static_cast<std::int64_t>(label_of(all.lo).bits())};
  return true;
}

std::vector<LabelList> LabelChunkBuilder::Chunk::tile_lists(Int3 b, const ReadBox& from) const {
  std::vector<LabelList> lists;
  const Int3 tile{kLabelLeaf, kLabelLeaf, kLabelLeaf};
  for_each_point({{0, 0, 0}, layout_.leaves_of_brick(b)}, [&](Int3 t) {
    const Int3 lo = b * kListedBrick + t * kLabelLeaf;
    lists.push_back(labels_in(builder_.store_.info().type, from, samples_of({lo, lo + tile})));
  });
  return lists;
}

void LabelChunkBuilder::Chunk::add(std::span<const Int3> bricks) {
  Box3 box;
  for (const Int3 b : bricks) box = unite(box, {b, b + Int3{1, 1, 1}});
  const ReadBox from{nullptr, samples_of({box.lo * kListedBrick, box.hi * kListedBrick})};
  samples_.resize(static_cast<std::size_t>(volume(from.box.extent())) *
                  size_of(builder_.store_.info().type));
  read_slab(builder_.store_, builder_.level_, from.box, samples_.data());
  std::vector<std::vector<std::byte>> parts(bricks.size());
  tbb::parallel_for(std::size_t{0}, bricks.size(), [&](std::size_t i) {
    const std::vector<LabelList> lists = tile_lists(bricks[i], {samples_.data(), from.box});
    LabelList& all = list_of(bricks[i]);
    for (const LabelList& list : lists) all.unite(list);
    if (all.is_cut || all.labels.size() > 1) parts[i] = encode_(pack_label_lists(lists));
  });
  for (std::size_t i = 0; i < bricks.size(); ++i)
    if (!parts[i].empty()) take_(layout_.part_of_brick(bricks[i]), std::move(parts[i]));
}

void LabelChunkBuilder::build(Int3 chunk, const EncodeIndexPart& encode,
                              const TakeIndexPart& take) const {
  Chunk(*this, chunk, encode, take).run();
}

MakeIndexParts label_index_parts(const StoreReader& store, int level, const IndexLayout& layout,
                                 std::uint64_t memory, int threads) {
  const auto builder = std::make_shared<LabelChunkBuilder>(store, level, layout, memory, threads);
  return [builder](Int3 c, const EncodeIndexPart& encode, const TakeIndexPart& take) {
    builder->build(c, encode, take);
  };
}

}  // namespace isobrick
