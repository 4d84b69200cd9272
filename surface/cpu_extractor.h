#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "surface/cap_bounds.h"
#include "surface/surface_extractor.h"
#include "surface/tile_places.h"

namespace isobrick::inline v0 {

/// What bounds an extractor's memory. Never shows in the mesh.
struct ExtractorLimits {
  /// Tiles between two hand-offs: a work space each.
  std::size_t tiles = 64;
  /// Bytes of mesh after which it is handed on; one tile may exceed them.
  std::uint64_t output_bytes = ~std::uint64_t{0};
};

struct TileState;
class TileSamples;

/// Work spaces for the tiles between two hand-offs. Extractors of one lattice may share them when
/// no two work at the same time.
class TileWorkSpaces {
 public:
  TileWorkSpaces();
  ~TileWorkSpaces();
  TileWorkSpaces(const TileWorkSpaces&) = delete;
  TileWorkSpaces& operator=(const TileWorkSpaces&) = delete;

  /// Work spaces that it holds: those of the last extractor's limit at most, when one begins.
  std::size_t size() const { return states_.size(); }

 private:
  friend class CpuExtractor;
  std::vector<std::unique_ptr<TileState>> states_;
};

/// Marching cubes on the CPU.
///
/// Two passes over a batch of tiles, each in parallel over its tiles. The first gathers samples,
/// makes inside bits, counts and numbers (count). A prefix sum gives every tile its place. The
/// second writes vertices and triangles there (write).
class CpuExtractor final : public SurfaceExtractor {
 public:
  /// Hands the mesh to `sink`, which must outlive it; without one the mesh stays in mesh(),
  /// whatever the limit of output. Has work spaces of its own where none are given. Throws
  /// UsageError when the isovalue is not a number or the roi is empty.
  CpuExtractor(const Lattice& lattice, const SurfaceOptions& options, ExtractorLimits limits,
               MeshSink* sink = nullptr, std::shared_ptr<TileWorkSpaces> spaces = nullptr);
  ~CpuExtractor() override;

  /// From now on makes the mesh of a part only, before the first tile: tiles before the part are
  /// counted, so that their vertices have numbers, but not written. `places`, which must outlive
  /// it, hears of all tiles with vertices or triangles, also left out, in order. Only of a welded
  /// mesh.
  void make_part(const TileRange& part, TilePlaces& places);

  /// Needs no samples any more when it returns.
  void extract(std::span<const TileWork> tiles, const BrickLookup& bricks,
               const std::shared_ptr<const void>& samples) override;
  /// The same with samples that may lie anywhere.
  void extract(std::span<const TileWork> tiles, const TileSamples& samples);
  void finish() override;
  SurfaceReport report() const override;

  /// What was extracted and is not the sink's.
  Mesh& mesh();

  /// Counts what extract() makes of one tile, wherever the tile comes in the order. Caps lie at the
  /// border of `region`, which may be larger than the roi.
  MeshSize count(const TileWork& tile, const BrickLookup& bricks, Box3 region) const;
  /// The same with caps at the border of the roi.
  MeshSize count(const TileWork& tile, const BrickLookup& bricks) const;

  /// Forgets all that was extracted: the next tile may be any again. Of an extractor without a
  /// sink.
  void restart();

  /// Tiles between two hand-offs that keep `threads` busy and their caches warm.
  static std::size_t preferred_batch(int threads);
  /// Bytes of work space for one tile, with its boundary.
  static std::uint64_t workspace_bytes(ScalarType type, bool drop_degenerate, Topology topology,
                                       const CapBounds& cap = {});
  /// Bytes of finished tiles that wait for later tiles at most, mostly: of a grid of tiles.
  static std::uint64_t boundary_bytes(Int3 tiles, bool drop_degenerate, const CapBounds& cap = {});
  /// Bytes of output that one tile can make at most.
  static std::uint64_t max_tile_output(bool normals, Topology topology, const CapBounds& cap = {});
  /// Vertices within a cell and triangles that one cell can make at most.
  static MeshSize max_in_cell(Topology topology);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick
