#pragma once

#include <cstddef>
#include <limits>
#include <optional>

#include <isobrick/api.h>
#include <isobrick/scalar.h>
#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// Edge, in cells, of the blocks whose ranges every store keeps (`block_range`).
/// Blocks lie on the volume's lattice, whatever the brick size.
inline constexpr Index kBlockEdge = 16;
/// Edge, in cells, of a tile: the unit of extraction. Tiles lie on the
/// volume's lattice too, and meshes are ordered by tile, so that the storage
/// layout never shows in a mesh.
inline constexpr Index kTileEdge = 32;

/// The samples of one level and how they are cut into bricks.
struct ISOBRICK_API Lattice {
  Int3 extent;                       ///< samples along x, y, z
  Int3 brick{64, 64, 64};            ///< samples of a brick along x, y, z
  ScalarType type = ScalarType::u8;  ///< of the samples

  friend bool operator==(const Lattice&, const Lattice&) = default;

  /// Number of bricks along x, y, z.
  Int3 bricks() const { return ceil_div(extent, brick); }
  /// Number of blocks along x, y, z.
  Int3 blocks() const { return ceil_div(extent, {kBlockEdge, kBlockEdge, kBlockEdge}); }
  /// Number of tiles along x, y, z.
  Int3 tiles() const { return ceil_div(extent, {kTileEdge, kTileEdge, kTileEdge}); }
  /// Bytes of a sample.
  std::size_t sample_bytes() const { return size_of(type); }
  /// Bytes of a decoded brick, at the volume's border too.
  std::size_t brick_bytes() const {
    return static_cast<std::size_t>(volume(brick)) * sample_bytes();
  }
  /// All samples.
  Box3 box() const { return {{0, 0, 0}, extent}; }
  /// The lattice points of brick `b`, also those beyond the volume's border.
  Box3 full_brick_box(Int3 b) const { return {b * brick, (b + Int3{1, 1, 1}) * brick}; }
  /// The samples that brick `b` holds, cut at the volume's border.
  Box3 brick_box(Int3 b) const { return intersect(full_brick_box(b), box()); }
  /// The brick that holds sample `p`.
  Int3 brick_of(Int3 p) const { return floor_div(p, brick); }
  /// The bricks that hold the samples of `samples`, which is not empty.
  Box3 bricks_of(Box3 samples) const { return {brick_of(samples.lo), ceil_div(samples.hi, brick)}; }
};

/// Number of samples, or nothing when an extent is not positive or the number
/// of bytes (with 8 bytes a sample) would not fit an Index.
constexpr std::optional<Index> checked_volume(Int3 e) {
  if (e.x <= 0 || e.y <= 0 || e.z <= 0) return std::nullopt;
  constexpr Index limit = std::numeric_limits<Index>::max() / 8;
  if (e.x > limit / e.y || e.x * e.y > limit / e.z) return std::nullopt;
  return e.x * e.y * e.z;
}

/// Looks decoded bricks up. The owner documents how long pointers stay valid.
class ISOBRICK_API BrickLookup {
 public:
  virtual ~BrickLookup() = default;
  /// The samples of brick `b`, C order [z, y, x] of the lattice's full brick
  /// extents also at the volume's border; null when the brick is absent (every
  /// sample is the fill value). Thread-safe.
  virtual const std::byte* find(Int3 b) const = 0;
};

}  // namespace isobrick
