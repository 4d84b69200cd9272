#include "pipeline/labels/label_list_search.h"

#include <algorithm>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "surface/labels/label_value.h"

namespace isobrick::inline v0 {
namespace {

constexpr Index kTilesOfBrick = IndexLayout::kBrick / kTileEdge;
constexpr Index kTilesOfChunk = IndexLayout::kChunk * kTilesOfBrick;
static_assert(kLabelLeaf == kTileEdge);

Int3 cube(Index edge) { return {edge, edge, edge}; }

}  // namespace

LabelListSearch::LabelListSearch(const StoreReader& store, int level, const LabelSelection& labels)
    : labels_(labels),
      lattice_(store.info().levels.at(static_cast<std::size_t>(level)).lattice),
      index_(store, level, kLabelIndex) {}

std::uint64_t LabelListSearch::bytes(const Lattice& lattice) {
  const auto bricks = static_cast<std::uint64_t>(
      volume(min(ceil_div(lattice.extent, cube(IndexLayout::kBrick)), cube(IndexLayout::kChunk))));
  // Encoded and decoded, and as lists; then the places of the parts.
  return 3 * max_label_list_bytes(bricks) + 32 * (bricks + 1);
}

bool LabelListSearch::meets(const LabelList& list) const {
  return list.is_cut ||
         std::any_of(list.labels.begin(), list.labels.end(), [this](std::int64_t label) {
           return labels_.contains(label_of_bits(static_cast<std::uint64_t>(label), lattice_.type));
         });
}

std::vector<LabelList> LabelListSearch::read(const IndexChunk& chunk, std::size_t part,
                                             Index items) const {
  std::vector<std::byte> bytes;
  if (!chunk.read(part, bytes))
    throw DamageError(fmt::format("'{}' has no directory", chunk.name()));
  if (bytes.size() > max_label_list_bytes(static_cast<std::uint64_t>(items)))
    throw DamageError(chunk.where(part) + ": broken lists of labels");
  try {
    return unpack_label_lists(bytes, static_cast<std::size_t>(items));
  } catch (const DamageError& e) {
    throw DamageError(fmt::format("{}: {}", chunk.where(part), e.what()));
  }
}

ListedTiles LabelListSearch::find(Int3 chunk) {
  const IndexLayout& layout = index_.layout();
  const Box3 all = intersect({chunk * kTilesOfChunk, (chunk + Int3{1, 1, 1}) * kTilesOfChunk},
                             {{0, 0, 0}, lattice_.tiles()});
  // Index bricks divide cells: a last sample behind them may be in a tile of its own.
  const Int3 tiles_of_cells = ceil_div(layout.cells(), cube(kTileEdge));
  const Box3 known = intersect(all, {{0, 0, 0}, tiles_of_cells});
  if (known.empty()) return {all, {all.lo, all.lo}};
  ListedTiles found(all, known);
  const IndexChunk file = index_.open(chunk);
  const Box3 bricks = layout.bricks_of_chunk(chunk);
  const std::vector<LabelList> directory =
      read(file, IndexLayout::kDirectory, volume(bricks.extent()));
  for_each_point(bricks, [&](Int3 b) {
    if (!meets(directory[static_cast<std::size_t>(linear_index(b - bricks.lo, bricks.extent()))]))
      return;
    const Int3 grid = layout.leaves_of_brick(b);
    std::vector<LabelList> tiles;
    // Without a part all tiles have the brick's only label.
    if (const std::size_t part = layout.part_of_brick(b); file.has(part))
      tiles = read(file, part, volume(grid));
    for_each_point({{0, 0, 0}, grid}, [&](Int3 t) {
      if (tiles.empty() || meets(tiles[static_cast<std::size_t>(linear_index(t, grid))]))
        found.mark(b * kTilesOfBrick + t);
    });
  });
  bytes_read_ += file.bytes_read();
  return found;
}

}  // namespace isobrick
