#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <isobrick/lattice.h>
#include "core/flat_map.h"
#include "core/tile.h"
#include "surface/labels/label_key.h"
#include "surface/labels/label_piece.h"
#include "surface/labels/label_points.h"
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

/// The samples and cells that the points of a tile depend on: edge³ from the window's origin on.
struct LabelWindow {
  int margin;  ///< cells before the tile's first one
  int edge;

  explicit LabelWindow(int reach)
      : margin(TileCells::kBefore + reach), edge(TileCells::kEdge + 2 * reach) {}

  int at(int x, int y, int z) const { return x + edge * (y + edge * z); }
  std::array<int, 3> place(int cell) const {
    return {cell % edge, cell / edge % edge, cell / (edge * edge)};
  }
  std::array<int, 3> steps() const { return {1, edge, edge * edge}; }
  std::size_t volume() const { return static_cast<std::size_t>(edge * edge * edge); }
  /// The window's first sample.
  Int3 origin(Int3 tile) const { return tile * kTileEdge - Int3{margin, margin, margin}; }
};

/// Rows of a window are words.
inline constexpr int kMaxLabelSmoothing = 6;
static_assert(TileCells::kEdge + 4 * kMaxLabelSmoothing <= 64);

/// Makes the pieces of tiles, one at a time. Reuse it: it keeps its memory.
class LabelTile {
 public:
  /// At most kMaxLabelSmoothing iterations.
  explicit LabelTile(const LabelSmoothing& smoothing = {});

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

  /// Layers of samples around a tile's own 33³ that it takes.
  static Index sample_reach(const LabelSmoothing& smoothing) {
    return TileCells::kBefore + smoothing.reach();
  }
  /// Bytes that one takes at most.
  static std::uint64_t max_bytes(ScalarType type, const LabelSmoothing& smoothing);

 private:
  using Id = std::uint16_t;
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
  Id id_of(const Label& label);
  void find_edges();
  void find_points();
  void add_point(int cell);
  void visit_cells();
  void visit_cell(int cell, const std::array<int, 3>& place);
  std::array<Id, 8> corner_ids(int cell) const;
  std::uint8_t corners_with(Id id, int cell) const;
  bool is_split(Id id, std::uint8_t corners, int cell) const;
  void add_vertices(Id id, std::uint8_t corners, int cell, bool is_foreign);
  std::uint32_t code_of(int cell) const;
  ForeignVertex foreign_vertex(int cell, std::uint32_t sheet) const;
  void visit_edges();
  void visit_edge(int axis, int x, int y, int z);
  void add_quad(Id id, int axis, const std::array<int, 4>& cells, bool is_upper);
  std::uint32_t vertex_of(Id id, int cell, int edge);
  Vec3f point_of(int cell) const;
  std::span<const LabelPiece> make_pieces();
  void sort_by_label();

  LabelSmoothing smoothing_;
  LabelWindow window_;
  Int3 tile_;
  /// Owned cells are those in [lo_, hi_) of the window.
  std::array<int, 3> lo_{}, hi_{};
  std::vector<std::byte> samples_;
  std::vector<Id> ids_;
  std::vector<Label> labels_;         ///< by id
  std::vector<std::uint8_t> chosen_;  ///< by id
  FlatMap<Id, LabelKey> id_of_;
  /// Bits x of each row (y, z): the sample differs from the next one along x, y and z.
  std::array<std::vector<std::uint64_t>, 3> differs_;
  LabelPoints points_;
  std::vector<std::uint32_t> first_entry_;  ///< of each point's cell
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
