#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <memory>

#include <isobrick/pod_buffer.h>
#include "core/tile.h"
#include "surface/cell_math.h"

namespace isobrick::inline v0 {

/// Samples along a tile's edge: those of its cells' corners.
inline constexpr int kTileSamples = static_cast<int>(kTileEdge) + 1;
/// Rows (y, z) of a tile's samples.
inline constexpr int kTileRows = kTileSamples * kTileSamples;

constexpr int row_index(int y, int z) { return z * kTileSamples + y; }

/// Where a tile's sample (x, y, z), each in −1 … 33, lies in the gathered
/// block: one layer before the tile and one after, for gradients and for NaN.
struct TileLayout {
  static constexpr int kRow = 40;
  static constexpr int kPlane = kRow * (kTileSamples + 2);
  static constexpr int kOrigin = kPlane + kRow + 1;
  /// With room for vector loads that run past the last row.
  static constexpr int kSize = kPlane * (kTileSamples + 2) + 64;
  static constexpr int offset(int x, int y, int z) { return kOrigin + z * kPlane + y * kRow + x; }
};

/// A tile cut to the volume or the region of interest, in its own coordinates.
struct TileShape {
  Int3 origin;       ///< of the tile, in samples
  int lo[3], hi[3];  ///< cells lo … hi − 1, samples lo … hi along x, y, z
  bool first[3];     ///< nothing lies before the tile along this axis: it owns its low plane
};

/// The vertices on the lattice edges of one row of samples. An edge lies in the
/// closed tiles around it and belongs to the lowest of them, so a tile owns its
/// upper planes, and its lower ones only at the border. Within a row vertices
/// are numbered along x, first those on edges along x, then y, then z.
/// Bit i of `x` is the edge i → i+1; bit i of `y` and `z` the edge that starts
/// at sample i + 1. The one at sample 0 has a number of its own, because it
/// mostly belongs to another tile than the rest of the row.
struct EdgeRow {
  std::uint32_t x = 0, y = 0, z = 0;
  std::uint32_t x_base = 0, y_base = 0, z_base = 0;
  std::uint32_t y_at_0 = 0, z_at_0 = 0;
};

/// A cell that the surface passes: x | y << 5 | z << 10 | case << 16.
using ActiveCell = std::uint32_t;

/// An active cell whose surface is not that of its case alone.
struct PatchedCell {
  ActiveCell cell;
  std::uint32_t patch;  ///< of TopologyTables
};

/// A vertex on the upper x face: row (y, z) and number within the tile.
struct FaceVertex {
  std::uint16_t row;
  std::uint32_t number;
};

/// A vertex on a sample on a tile's planes: place as in SampleVertex and number within the tile.
struct SharedSample {
  std::uint32_t place, number;
};

/// What later tiles need of a finished one: the vertices on its upper planes,
/// and those on samples on all its planes.
struct TileBoundary {
  std::uint32_t base = 0;  ///< number of the tile's first vertex in the mesh
  bool empty = true;       ///< no vertex: what follows holds anything
  /// Rows with y = 32 (by z) and rows with z = 32 (by y); numbers count from `base`.
  std::array<EdgeRow, kTileSamples> y_face, z_face;
  PodBuffer<FaceVertex> x_face_y, x_face_z;  ///< edges along y and along z at x = 32
  PodBuffer<SharedSample> on_samples;        ///< vertices on samples, by place
};

/// A vertex on a sample that triangles of a tile have corners on.
struct SampleVertex {
  static constexpr std::uint8_t kOwn = 13;
  std::uint32_t place;  ///< x | y << 6 | z << 12
  std::uint32_t number;
  std::uint8_t owner;  ///< which of the 27 tiles around this one makes it; kOwn: this one
  bool of_surface;     ///< whether triangles of the surface meet there, and not only the cap's
};

/// The vertices of a tile on samples: coincident ones (coincident_vertices.h) and those of caps
/// (cap.h).
struct SampleVertices {
  std::uint64_t used[kTileRows];     ///< bit x: a triangle of this tile has a corner on sample x
  std::uint32_t first[kTileRows];    ///< which of `vertices` is the row's first
  PodBuffer<SampleVertex> vertices;  ///< the used ones, by place
  std::uint32_t own = 0;             ///< of the vertices made by this tile

  void clear() {
    std::fill(std::begin(used), std::end(used), 0);
    vertices.clear();
    own = 0;
  }
};

/// The coincident vertices of a tile, where degenerate triangles are left out.
struct CoincidentVertices {
  /// Bit x: sample x is a coincident vertex. A row and a sample more than there are, always 0.
  std::uint64_t at[kTileRows + kTileSamples + 1] = {};
  PodBuffer<ActiveCell> cells;  ///< with a coincident vertex; they are not in TileState::cells
  std::uint32_t triangles = 0;  ///< of these cells that are kept
  std::uint32_t left_out = 0;   ///< triangles
  std::uint32_t patched_left_out = 0;  ///< of them those of patched cells

  void clear() {
    cells.clear();
    triangles = left_out = patched_left_out = 0;
  }
};

/// The cells around a tile that exist, as rows of bits: row (y, z) and bit x + 1 for cell
/// (x, y, z), each in −1 … 32. Cells outside of the region or with a NaN corner do not.
struct ExistingCells {
  static constexpr int kEdge = kTileSamples + 1;
  std::uint64_t rows[kEdge * kEdge];
  std::uint64_t at(int y, int z) const { return rows[(z + 1) * kEdge + y + 1]; }
};

/// A border face with a part inside: x | y << 5 | z << 10 | face << 15 | polygon << 18.
using CapFace = std::uint32_t;

/// What closes the surface of a tile at the border (see cap.h).
struct TileCap {
  ExistingCells cells;
  bool near = false;  ///< whether cells around the tile may lack; else `cells` holds anything
  PodBuffer<CapFace> faces;
  std::uint32_t triangles = 0;

  void clear() {
    near = false;
    faces.clear();
    triangles = 0;
  }
};

/// Work space for one tile between counting and writing.
struct TileState {
  TileWork work;
  TileShape shape;
  PodBuffer<std::byte> samples;  ///< TileLayout, of the sample type
  /// Bit x: sample x is inside. With room for vector loads that run past the last row.
  alignas(64) std::uint64_t inside[kTileRows + 2 * kTileSamples] = {};
  alignas(64) EdgeRow rows[kTileRows];
  /// Own edges at sample 0 of a row: bit 0 along y, bit 1 along z.
  std::uint8_t own_at_0[kTileRows] = {};
  /// Bit y of word z: row (y, z) was written to. All other rows (and their
  /// own_at_0) are zero, so that a tile with little in it costs little.
  std::uint64_t written[kTileSamples] = {};
  PodBuffer<ActiveCell> cells;
  PodBuffer<std::uint32_t>
      edges;  ///< own edges in the order of their vertices: x | y << 6 | z << 12 | axis << 18
  std::uint32_t vertices = 0, triangles = 0;
  /// Vertices on edges. Inner ones follow, then those on samples.
  std::uint32_t edge_vertices = 0;
  std::uint32_t inner_vertices = 0;     ///< of patched cells
  PodBuffer<PatchedCell> patched;       ///< cells that are not in `cells`; of Topology::trilinear
  std::uint32_t patched_triangles = 0;  ///< of `triangles`, the last before the cap's
  std::unique_ptr<CoincidentVertices> coincident;    ///< where degenerate triangles are left out
  std::unique_ptr<TileCap> cap;                      ///< of a capped surface
  std::unique_ptr<SampleVertices> on_samples;        ///< with either of these
  std::uint64_t vertex_base = 0, triangle_base = 0;  ///< where this tile's output goes
  std::uint32_t number_base = 0;                     ///< what its vertices are numbered from
  TileBoundary* boundary = nullptr;                  ///< of this tile, when later tiles need it

  std::uint32_t cap_triangles() const { return cap ? cap->triangles : 0; }
  void clear_patched() {
    patched.clear();
    inner_vertices = patched_triangles = 0;
  }
  EdgeRow& write_row(int y, int z) {
    written[z] |= std::uint64_t{1} << y;
    return rows[row_index(y, z)];
  }
  /// Calls f(y, z) for the rows that were written to, in their order.
  template <class F>
  void for_each_written(F&& f) const {
    for (int z = 0; z < kTileSamples; ++z)
      for (std::uint64_t word = written[z]; word; word &= word - 1) f(std::countr_zero(word), z);
  }
  void clear_rows() {
    for_each_written([this](int y, int z) {
      rows[row_index(y, z)] = {};
      own_at_0[row_index(y, z)] = 0;
    });
    std::fill(std::begin(written), std::end(written), 0);
  }
};

}  // namespace isobrick
