#include "surface/boundary_map.h"

#include <algorithm>
#include <bit>

#include "core/morton.h"

namespace isobrick::inline v0 {
namespace {

constexpr int kLast = kTileSamples - 1;

void shift(EdgeRow& row, std::uint32_t base) {
  row.x_base += base;
  row.y_base += base;
  row.z_base += base;
  row.y_at_0 += base;
  row.z_at_0 += base;
}

void adopt_x(EdgeRow& row, const EdgeRow& from, std::uint32_t base) {
  row.x = from.x;
  row.x_base = from.x_base + base;
}

void adopt_y(EdgeRow& row, const EdgeRow& from, std::uint32_t base) {
  row.y = from.y;
  row.y_base = from.y_base + base;
  row.y_at_0 = from.y_at_0 + base;
}

void adopt_z(EdgeRow& row, const EdgeRow& from, std::uint32_t base) {
  row.z = from.z;
  row.z_base = from.z_base + base;
  row.z_at_0 = from.z_at_0 + base;
}

/// Edges at sample 0 of the rows (y, z) from the x face of a tile before; `dy`
/// and `dz` say whether that tile also lies before along y and z, where its
/// last row is our first.
template <bool AlongY>
void adopt_x_face(TileState& tile, const TileBoundary& from, bool dy, bool dz) {
  for (const FaceVertex& v : AlongY ? from.x_face_y : from.x_face_z) {
    int y = v.row % kTileSamples, z = v.row / kTileSamples;
    if ((dy && y != kLast) || (dz && z != kLast)) continue;
    if (dy) y = 0;
    if (dz) z = 0;
    EdgeRow& row = tile.write_row(y, z);
    (AlongY ? row.y_at_0 : row.z_at_0) = from.base + v.number;
  }
}

}  // namespace

TileBoundary* BoundaryMap::add(Int3 tile) {
  const std::uint64_t key = morton_encode(tile);
  std::unique_ptr<TileBoundary> boundary;
  if (spare_.empty()) {
    boundary = std::make_unique<TileBoundary>();
  } else {
    boundary = std::move(spare_.back());
    spare_.pop_back();
  }
  expiries_.push({morton_encode(min(tile + Int3{1, 1, 1}, last_tile_)), key});
  return (map_[key] = std::move(boundary)).get();
}

const TileBoundary* BoundaryMap::find(Int3 tile) const {
  const auto found = map_.find(morton_encode(tile));
  return found == map_.end() || found->second->empty ? nullptr : found->second.get();
}

void BoundaryMap::forget_before(Int3 next) {
  const std::uint64_t now = morton_encode(next);
  while (!expiries_.empty() && expiries_.top().last_asker < now) {
    const auto found = map_.find(expiries_.top().key);
    // Pages of tiles with much on their faces go back rather than to the pool.
    if (spare_.size() < 4096) spare_.push_back(std::move(found->second));
    map_.erase(found);
    expiries_.pop();
  }
}

// A tile waits for its last asker, one step up along each axis. Take the smallest aligned cube of
// tiles that holds both. The next tile lies between them in Morton order, so in the same cube, and
// the step crosses the middle of the cube along some axis. So the tile lies in one of the layers
// below the middles of the cubes around the next tile: three of each size, those along an axis only
// while the grid goes beyond the middle. Only the last tile of the grid waits for itself.
// The layers of all sizes are never full at once. No grid holds more than its three upper faces,
// which is less for a grid that is about a cube; the tests count it.
std::uint64_t BoundaryMap::max_size(Int3 tiles) {
  std::uint64_t layers = 1, faces = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const Index a = tiles[(axis + 1) % 3], b = tiles[(axis + 2) % 3];
    faces += static_cast<std::uint64_t>(a * b);
    for (Index edge = 2; edge / 2 < tiles[axis]; edge *= 2)
      layers += static_cast<std::uint64_t>(std::min(a, edge) * std::min(b, edge));
  }
  return std::min(layers, faces);
}

void BoundaryMap::clear() {
  map_.clear();
  expiries_ = {};
}

void publish_boundary(TileState& tile) {
  TileBoundary& boundary = *tile.boundary;
  boundary.empty = tile.vertices == 0;
  if (boundary.empty) return;
  for (int i = 0; i < kTileSamples; ++i) {
    boundary.y_face[static_cast<std::size_t>(i)] = tile.rows[row_index(kLast, i)];
    boundary.z_face[static_cast<std::size_t>(i)] = tile.rows[row_index(i, kLast)];
  }
  boundary.x_face_y.clear();
  boundary.x_face_z.clear();
  const auto append = [](PodBuffer<FaceVertex>& to, int r, std::uint32_t base, std::uint32_t word) {
    // Sample 32 is the last bit, so its vertex is the last of the word.
    if (!(word >> 31)) return;
    to.resize(to.size() + 1);
    to[to.size() - 1] = {static_cast<std::uint16_t>(r),
                         base + static_cast<std::uint32_t>(std::popcount(word)) - 1};
  };
  tile.for_each_written([&](int y, int z) {
    const int r = row_index(y, z);
    append(boundary.x_face_y, r, tile.rows[r].y_base, tile.rows[r].y);
    append(boundary.x_face_z, r, tile.rows[r].z_base, tile.rows[r].z);
  });
}

void adopt_boundaries(TileState& tile, const BoundaryMap& map) {
  if (tile.number_base != 0)
    tile.for_each_written(
        [&](int y, int z) { shift(tile.rows[row_index(y, z)], tile.number_base); });
  const bool* first = tile.shape.first;
  const auto before = [&](bool x, bool y, bool z) -> const TileBoundary* {
    if ((x && first[0]) || (y && first[1]) || (z && first[2])) return nullptr;
    return map.find(tile.work.tile - Int3{x, y, z});
  };
  // Where two low planes meet, edges along both belong to the tile before both.
  if (const TileBoundary* b = before(false, true, false))
    for (int z = 0; z < kTileSamples; ++z) {
      const EdgeRow& from = b->y_face[static_cast<std::size_t>(z)];
      if (z > 0 || first[2]) adopt_x(tile.write_row(0, z), from, b->base);
      adopt_z(tile.write_row(0, z), from, b->base);
    }
  if (const TileBoundary* b = before(false, false, true))
    for (int y = 0; y < kTileSamples; ++y) {
      const EdgeRow& from = b->z_face[static_cast<std::size_t>(y)];
      if (y > 0 || first[1]) adopt_x(tile.write_row(y, 0), from, b->base);
      adopt_y(tile.write_row(y, 0), from, b->base);
    }
  if (const TileBoundary* b = before(false, true, true))
    adopt_x(tile.write_row(0, 0), b->y_face[kLast], b->base);
  if (const TileBoundary* b = before(true, false, false)) {
    adopt_x_face<true>(tile, *b, false, false);
    adopt_x_face<false>(tile, *b, false, false);
  }
  if (const TileBoundary* b = before(true, true, false)) adopt_x_face<false>(tile, *b, true, false);
  if (const TileBoundary* b = before(true, false, true)) adopt_x_face<true>(tile, *b, false, true);
}

}  // namespace isobrick
