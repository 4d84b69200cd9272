#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <isobrick/lattice.h>
#include "core/flat_map.h"
#include "core/tile.h"
#include "surface/tile_samples.h"

// Surface nets of labels (Gibson 1998): the boundary of each label in a tile.
//
// A cell whose corners differ has one point, the mean of the middles of its edges whose ends
// differ. Each such lattice edge has a quad between the points of the four cells around it, for
// each of the two labels, oppositely oriented. So walls between labels coincide exactly, and at a
// place where several labels meet they share the point. In each mesh a point has a vertex for each
// sheet of the label (sheet_tables.h), which makes the mesh a closed manifold.
//
// What lies outside of the region is a label of its own, so labels are closed there, half a sample
// beyond the last one. Cells therefore begin one before the first sample.

namespace isobrick::inline v0 {

/// A place in a tile's window of cells, x + kEdge · (y + kEdge · z).
struct LabelWindow {
  /// Samples and cells along each axis. The window's first sample, and its first cell, is
  /// kBefore before the tile's first one.
  static constexpr int kBefore = 2;
  static constexpr int kEdge = kTileEdge + 5;
  static constexpr int kVolume = kEdge * kEdge * kEdge;

  static constexpr int at(int x, int y, int z) { return x + kEdge * (y + kEdge * z); }
  static constexpr std::array<int, 3> place(int at) {
    return {at % kEdge, at / kEdge % kEdge, at / (kEdge * kEdge)};
  }
  /// The window's first sample.
  static constexpr Int3 origin(Int3 tile) {
    return tile * kTileEdge - Int3{kBefore, kBefore, kBefore};
  }
};

/// A vertex that a tile owns: its cell in the window (16 bits), then which of the cell's edges have
/// ends of different labels (12 bits).
using LabelVertex = std::uint32_t;
constexpr int cell_of(LabelVertex v) { return static_cast<int>(v & 0xffff); }
constexpr int edges_of(LabelVertex v) { return static_cast<int>(v >> 16); }

/// The point of a cell, in index space.
Vec3d label_point(Int3 tile, LabelVertex v);

/// A vertex that a neighbour above owns: the neighbour (3 bits, x the lowest), the cell in the
/// neighbour's window (16 bits) and the label's sheet in it (2 bits).
struct ForeignVertex {
  std::uint32_t bits = 0;

  Int3 neighbour() const {
    return {static_cast<Index>(bits & 1), static_cast<Index>(bits >> 1 & 1),
            static_cast<Index>(bits >> 2 & 1)};
  }
  int cell() const { return static_cast<int>(bits >> 3 & 0xffff); }
  int sheet() const { return static_cast<int>(bits >> 19); }
  friend bool operator==(ForeignVertex, ForeignVertex) = default;
};

/// Four vertices, counter-clockwise seen from outside the label; it is divided between the first
/// and the third. Numbers below the count of owned vertices are theirs, the others, less that
/// count, those of the foreign ones.
using LabelQuad = std::array<std::uint32_t, 4>;

/// What a tile has of one label.
struct LabelPiece {
  std::int64_t label = 0;
  std::span<const LabelVertex> vertices;  ///< in the order of the cells, then of the sheets
  std::span<const ForeignVertex> foreign;
  std::span<const LabelQuad> quads;
};

/// Makes the pieces of tiles, one at a time. Reuse it: it keeps its memory.
class LabelTile {
 public:
  LabelTile();

  /// The tile's labels within `roi`. `is_chosen(label)` says which are requested; the others have
  /// no pieces, but the same places. `fill` is of absent bricks. Throws Error where a sample is no
  /// whole number; NaN has no label. The pieces are valid until the next call.
  template <class IsChosen>
  std::span<const LabelPiece> make(const TileSamples& samples, ScalarType type, Int3 tile, Box3 roi,
                                   const IsChosen& is_chosen) {
    read(samples, type, tile, roi);
    for (std::size_t id = 1; id < labels_.size(); ++id) chosen_[id] = is_chosen(labels_[id]);
    return make_pieces();
  }

  /// Bytes that one takes at most.
  static std::uint64_t max_bytes(ScalarType type);

 private:
  using Id = std::uint16_t;
  static constexpr int kEdge = LabelWindow::kEdge;
  static constexpr Id kOutside = 0;  ///< of the region, and of samples without a label

  /// In numbers of vertices: of a foreign vertex, and of one that no quad has named yet.
  static constexpr std::uint32_t kForeign = std::uint32_t{1} << 31;
  static constexpr std::uint32_t kUnused = ~std::uint32_t{0};

  /// What a label has in a cell.
  struct Entry {
    Id id;
    std::uint8_t corners;        ///< that have the label
    bool is_split;               ///< its pinched face
    std::uint32_t first_vertex;  ///< of its sheets; kForeign and kUnused as they apply
  };
  /// An item of a label.
  template <class T>
  struct Of {
    Id id;
    T item;
  };
  /// How many items a label has.
  struct Counts {
    std::uint32_t vertices = 0, foreign = 0, quads = 0;
  };

  void read(const TileSamples& samples, ScalarType type, Int3 tile, Box3 roi);
  template <class T>
  void number_labels(Box3 roi);
  Id id_of(std::int64_t label);
  void find_edges();
  void visit_cells();
  void visit_cell(int x, int y, int z);
  std::uint8_t corners_with(Id id, int cell) const;
  bool is_split(Id id, std::uint8_t corners, int cell) const;
  void add_vertices(Id id, std::uint8_t corners, int cell, bool is_foreign);
  LabelVertex vertex_in(int cell) const {
    return static_cast<LabelVertex>(cell) |
           static_cast<LabelVertex>(cell_edges_[static_cast<std::size_t>(cell)]) << 16;
  }
  void visit_edges();
  void visit_edge(int axis, int x, int y, int z);
  void add_quad(Id id, int axis, const std::array<int, 4>& cells, bool is_upper);
  std::uint32_t vertex_of(Id id, int cell, int edge);
  std::span<const LabelPiece> make_pieces();
  void sort_by_label();

  Int3 tile_;
  /// Owned cells are those in [lo_, hi_) of the window.
  std::array<int, 3> lo_{}, hi_{};
  std::vector<std::byte> samples_;
  std::vector<Id> ids_;
  std::vector<std::int64_t> labels_;  ///< by id
  std::vector<std::uint8_t> chosen_;  ///< by id
  FlatMap<Id> id_of_;
  /// Bits x of each row (y, z): the sample differs from the next one along x, y and z.
  std::array<std::vector<std::uint64_t>, 3> differs_;
  // Of each cell whose corners differ.
  std::vector<std::uint16_t> cell_edges_;
  std::vector<std::uint32_t> first_entry_;
  std::vector<Entry> entries_;
  std::vector<Of<LabelVertex>> owned_;
  std::vector<Of<ForeignVertex>> foreign_;
  std::vector<Of<LabelQuad>> quads_;
  std::vector<Counts> counts_, starts_;  ///< by id
  std::vector<LabelVertex> sorted_vertices_;
  std::vector<ForeignVertex> sorted_foreign_;
  std::vector<LabelQuad> sorted_quads_;
  std::vector<LabelPiece> pieces_;
};

}  // namespace isobrick
