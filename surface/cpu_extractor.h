#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include <isobrick/surface_options.h>
#include "core/tile.h"

namespace isobrick {

/// How many layers of samples around its cells a tile needs: one for gradients
/// and for looking at the neighbours of NaN and of samples that equal the
/// isovalue, none otherwise.
Index sample_reach(const SurfaceOptions& options);

/// What bounds an extractor's memory. Never shows in the mesh.
struct ExtractorLimits {
  /// Tiles between two hand-offs: a work space each.
  std::size_t tiles = 64;
  /// Bytes of mesh after which it is handed on; one tile may exceed them.
  std::uint64_t output_bytes = ~std::uint64_t{0};
};

/// Takes what was extracted so far and leaves the buffer empty (or another
/// empty one in its place). The chunk's first vertex comes along.
using TakeMesh = std::function<void(MeshBuffer& mesh, std::uint64_t first_vertex)>;

struct TileState;

/// Work spaces for the tiles between two hand-offs. Extractors of one lattice may share them when
/// no two work at the same time.
class TileWorkSpaces {
 public:
  TileWorkSpaces();
  ~TileWorkSpaces();
  TileWorkSpaces(const TileWorkSpaces&) = delete;
  TileWorkSpaces& operator=(const TileWorkSpaces&) = delete;

 private:
  friend class CpuExtractor;
  std::vector<std::unique_ptr<TileState>> states_;
};

/// Marching cubes on the CPU: tiles in, indexed welded mesh out.
///
/// Two passes over a batch of tiles, each in parallel over its tiles: the first
/// gathers samples and makes inside bits, counts and numbers (count); a prefix
/// sum gives every tile its place; the second writes vertices and triangles
/// where they belong (emit). The mesh is a pure function of samples and
/// options, in Morton order of tiles.
class CpuExtractor {
 public:
  /// Has work spaces of its own where none are given. Throws UsageError when the isovalue is not
  /// a number or the roi is empty.
  CpuExtractor(const Lattice& lattice, const SurfaceOptions& options, ExtractorLimits limits,
               std::shared_ptr<TileWorkSpaces> spaces = nullptr);
  ~CpuExtractor();

  /// Appends the surface in `tiles` to `out`, or hands it to `take` whenever the
  /// limits say so and at the end. Over all calls, tiles come in
  /// Morton order, none twice; `bricks` holds those of for_each_needed_box.
  /// Runs in the caller's TBB arena. Throws Error when a welded mesh gets more
  /// vertices than 32 bits number.
  void extract(std::span<const TileWork> tiles, const BrickLookup& bricks, MeshBuffer& out,
               const TakeMesh& take = {});

  /// Counts what extract() makes of one tile, wherever the tile comes in the order.
  MeshSize count(const TileWork& tile, const BrickLookup& bricks) const;

  /// Forgets all that was extracted: the next tile may be any again.
  void restart();

  /// Vertices and triangles made so far.
  std::uint64_t vertices() const;
  std::uint64_t triangles() const;
  /// Triangles left out so far (SurfaceOptions::drop_degenerate).
  std::uint64_t degenerate_triangles() const;

  /// Tiles between two hand-offs that keep `threads` busy and their caches warm.
  static std::size_t preferred_batch(int threads);
  /// Bytes of work space for one tile.
  static std::uint64_t workspace_bytes(ScalarType type, bool drop_degenerate);
  /// Bytes of a finished tile that wait for later tiles, mostly.
  static std::uint64_t boundary_bytes(bool drop_degenerate);
  /// Bytes of output that one tile can make at most.
  static std::uint64_t max_tile_output(bool normals);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick
