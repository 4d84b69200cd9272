#include "pipeline/labels/label_mesh.h"

#include <algorithm>
#include <limits>
#include <queue>
#include <unordered_map>
#include <vector>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "core/morton.h"
#include "surface/world_map.h"

namespace isobrick::inline v0 {
namespace {

/// Numbers of the vertices that tiles below may name: those in a tile's first planes of cells.
///
/// Tiles come from the last to the first in Morton order, so a tile's upper neighbours are there
/// when it comes. They are forgotten when all their lower neighbours had their turn.
class Frontier {
 public:
  /// A tile whose vertices are numbered from `first` on.
  void add(const SpooledPiece& piece, std::uint32_t first) {
    std::vector<Named>& named = vertices_of_[morton_encode(piece.tile)];
    int last_cell = -1;
    for (std::size_t i = 0; i < piece.vertices.size(); ++i) {
      const int cell = cell_of(piece.vertices[i]);
      if (cell != last_cell && is_in_first_plane(cell))
        named.push_back({cell, first + static_cast<std::uint32_t>(i)});
      last_cell = cell;
    }
    const Int3 lowest = max(piece.tile - Int3{1, 1, 1}, {0, 0, 0});
    until_.push({morton_encode(lowest), morton_encode(piece.tile)});
  }

  /// The number of a vertex that a neighbour of `tile` owns.
  std::uint32_t number_of(Int3 tile, ForeignVertex vertex) const {
    const auto found = vertices_of_.find(morton_encode(tile + vertex.neighbour()));
    if (found == vertices_of_.end()) missing();
    const std::vector<Named>& named = found->second;
    const auto at = std::lower_bound(named.begin(), named.end(), vertex.cell(),
                                     [](const Named& n, int cell) { return n.cell < cell; });
    if (at == named.end() || at->cell != vertex.cell()) missing();
    return at->number + static_cast<std::uint32_t>(vertex.sheet());
  }

  /// Forgets what no tile before `tile` names.
  void advance(Int3 tile) {
    const std::uint64_t code = morton_encode(tile);
    for (; !until_.empty() && until_.top().first >= code; until_.pop())
      vertices_of_.erase(until_.top().second);
  }

 private:
  /// The first vertex of a cell.
  struct Named {
    int cell;
    std::uint32_t number;
  };

  static bool is_in_first_plane(int cell) {
    const auto place = LabelWindow::place(cell);
    return std::find(place.begin(), place.end(), LabelWindow::kBefore) != place.end();
  }
  [[noreturn]] static void missing() {
    throw std::logic_error("a label's tile names a vertex that its neighbour does not have");
  }

  std::unordered_map<std::uint64_t, std::vector<Named>> vertices_of_;  ///< by the tile's code
  /// The last tile that needs another one, and that one.
  std::priority_queue<std::pair<std::uint64_t, std::uint64_t>> until_;
};

Vec3f as_position(Vec3d p) {
  return {static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)};
}

}  // namespace

void SpooledLabelMesh::write(MeshSink& sink) const {
  if (chain_.vertices > std::numeric_limits<std::uint32_t>::max())
    throw Error(
        fmt::format("label {} has {} vertices, and a mesh has 2^32 - 1 at most; choose a "
                    "coarser level or a region",
                    chain_.label, chain_.vertices));
  const bool mirrored = world_map(transform_).mirrored;
  sink.begin(header_);
  Frontier frontier;
  SpooledPiece piece;
  std::vector<Vec3f> positions;
  std::vector<Triangle> triangles;
  std::uint32_t first = 0;
  for (std::uint64_t place = chain_.last; place != LabelSpool::kNoPiece; place = piece.previous) {
    if (cancel_.stop_requested()) throw Cancelled("the operation was cancelled");
    spool_.read(place, piece);
    const auto owned = static_cast<std::uint32_t>(piece.vertices.size());
    positions.clear();
    for (const LabelVertex v : piece.vertices)
      positions.push_back(as_position(transform_.apply(label_point(piece.tile, v))));
    const auto number = [&](std::uint32_t v) {
      return v < owned ? first + v : frontier.number_of(piece.tile, piece.foreign[v - owned]);
    };
    triangles.clear();
    for (const LabelQuad& quad : piece.quads) {
      const std::uint32_t a = number(quad[0]), c = number(quad[2]);
      std::uint32_t b = number(quad[1]), d = number(quad[3]);
      if (mirrored) std::swap(b, d);
      triangles.push_back({a, b, c});
      triangles.push_back({a, c, d});
    }
    sink.write({first, positions, {}, triangles});
    frontier.add(piece, first);
    frontier.advance(piece.tile);
    first += owned;
  }
  sink.finish();
}

}  // namespace isobrick
