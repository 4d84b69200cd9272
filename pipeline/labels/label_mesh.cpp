#include "pipeline/labels/label_mesh.h"

#include <algorithm>
#include <array>
#include <queue>
#include <type_traits>
#include <unordered_map>
#include <vector>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "core/morton.h"
#include "surface/world_map.h"

namespace isobrick::inline v0 {
namespace {

/// A vertex that a tile owns: its place in the mesh. Numbers have 32 bits, or 64 in a mesh of more.
template <class Number>
struct PlacedVertex {
  Number number = 0;
  Vec3f position;
};

/// The vertices that tiles below may name: those in a tile's first planes of cells.
///
/// Tiles come from the last to the first in Morton order, so a tile's upper neighbours are there
/// when it comes. They are forgotten when all their lower neighbours had their turn.
template <class Number>
class Frontier {
 public:
  /// A tile whose vertices, at `positions`, are numbered from `first` on.
  void add(const SpooledPiece& piece, Number first, std::span<const Vec3f> positions) {
    std::vector<Named>& named = vertices_of_[morton_encode(piece.tile)];
    std::uint32_t last_cell = ~std::uint32_t{0};
    for (std::size_t i = 0; i < positions.size(); ++i) {
      const std::uint32_t cell = piece.vertices[i].cell;
      if (cell != last_cell && is_in_first_plane(cell))
        named.push_back({cell, {first + static_cast<Number>(i), positions[i]}});
      last_cell = cell;
    }
    vertices_ = first + static_cast<Number>(positions.size());
    const Int3 lowest = max(piece.tile - Int3{1, 1, 1}, {0, 0, 0});
    until_.push({morton_encode(lowest), morton_encode(piece.tile)});
  }

  /// A vertex that a neighbour of `tile` owns.
  PlacedVertex<Number> find(Int3 tile, ForeignVertex vertex) const {
    const auto found = vertices_of_.find(morton_encode(tile + vertex.neighbour()));
    if (found == vertices_of_.end()) missing();
    const std::vector<Named>& named = found->second;
    const auto at =
        std::lower_bound(named.begin(), named.end(), vertex.cell(),
                         [](const Named& n, std::uint32_t cell) { return n.cell < cell; });
    if (at == named.end() || at->cell != vertex.cell()) missing();
    // The sheets of a cell follow one another, all at the same place.
    if (vertex.sheet() >= vertices_ - at->first.number) missing();
    return {at->first.number + vertex.sheet(), at->first.position};
  }

  /// Forgets what no tile before `tile` names.
  void advance(Int3 tile) {
    const std::uint64_t code = morton_encode(tile);
    for (; !until_.empty() && until_.top().first >= code; until_.pop())
      vertices_of_.erase(until_.top().second);
  }

 private:
  struct Named {
    std::uint32_t cell;
    PlacedVertex<Number> first;  ///< of the cell's
  };

  static bool is_in_first_plane(std::uint32_t cell) {
    const auto place = TileCells::place(static_cast<int>(cell));
    return std::find(place.begin(), place.end(), TileCells::kBefore) != place.end();
  }
  [[noreturn]] static void missing() {
    throw DamageError("a label's tile names a vertex that its neighbour does not have");
  }

  std::unordered_map<std::uint64_t, std::vector<Named>> vertices_of_;  ///< by the tile's code
  Number vertices_ = 0;                                                ///< so far
  /// The last tile that needs another one, and that one.
  std::priority_queue<std::pair<std::uint64_t, std::uint64_t>> until_;
};

Vec3f position_of(const LabelVertex& v, Int3 tile, const Transform& transform) {
  const auto place = TileCells::place(static_cast<int>(v.cell));
  Vec3d p;
  for (int axis = 0; axis < 3; ++axis) {
    const Index cell =
        tile[axis] * kTileEdge - TileCells::kBefore + place[static_cast<std::size_t>(axis)];
    p[axis] = static_cast<double>(cell) + static_cast<double>(v.in_cell[axis]);
  }
  p = transform.apply(p);
  return {static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)};
}

/// Makes the chunks of a mesh, a tile each.
template <class Number>
class ChunkMaker {
 public:
  ChunkMaker(const Transform& transform, Indexing indexing)
      : transform_(transform),
        mirrored_(world_map(transform).mirrored),
        is_welded_(indexing == Indexing::welded) {}

  /// Valid until the next call.
  MeshChunk make(const SpooledPiece& piece) {
    const auto owned = static_cast<std::uint32_t>(piece.vertices.size());
    positions_.clear();
    for (const LabelVertex& v : piece.vertices)
      positions_.push_back(position_of(v, piece.tile, transform_));
    frontier_.add(piece, static_cast<Number>(first_), positions_);
    numbers_.clear();
    const auto first = static_cast<Number>(first_);
    for (Number i = 0; i < owned; ++i) numbers_.push_back(is_welded_ ? first + i : i);
    for (const ForeignVertex v : piece.foreign) {
      const PlacedVertex<Number> vertex = frontier_.find(piece.tile, v);
      numbers_.push_back(is_welded_ ? vertex.number : static_cast<Number>(positions_.size()));
      if (!is_welded_) positions_.push_back(vertex.position);
    }
    triangles_.clear();
    for (const LabelQuad& quad : piece.quads) {
      const Number a = numbers_[quad[0]], c = numbers_[quad[2]];
      const Number b = numbers_[quad[mirrored_ ? 3 : 1]], d = numbers_[quad[mirrored_ ? 1 : 3]];
      triangles_.push_back({a, b, c});
      triangles_.push_back({a, c, d});
    }
    frontier_.advance(piece.tile);
    MeshChunk chunk{.first_vertex = first_, .positions = positions_};
    if constexpr (std::is_same_v<Number, std::uint64_t>)
      chunk.wide_triangles = triangles_;
    else
      chunk.triangles = triangles_;
    first_ += owned;
    return chunk;
  }

 private:
  const Transform& transform_;
  bool mirrored_, is_welded_;
  Frontier<Number> frontier_;
  std::uint64_t first_ = 0;  ///< vertices of the tiles before
  std::vector<Vec3f> positions_;
  std::vector<Number> numbers_;  ///< of the owned vertices, then of the foreign ones
  std::vector<std::array<Number, 3>> triangles_;
};

}  // namespace

template <class Number>
void SpooledLabelMesh::write_chunks(MeshSink& sink) const {
  ChunkMaker<Number> chunks(transform_, sink.indexing());
  SpooledPiece piece;
  for (std::uint64_t place = chain_.last; place != LabelSpool::kNoPiece; place = piece.previous) {
    if (cancel_.stop_requested()) throw Cancelled("the operation was cancelled");
    spool_.read(place, piece);
    sink.write(chunks.make(piece));
  }
}

void SpooledLabelMesh::write(MeshSink& sink) const {
  MeshHeader header = header_;
  header.wide = sink.indexing() == Indexing::welded && chain_.vertices > max_narrow_vertices_;
  if (header.wide && !sink.takes_wide())
    throw Error(
        fmt::format("label {} has {} vertices, which this output cannot number: choose VTP, OBJ, "
                    "GLB or levels of detail, a filter that makes it smaller, a coarser level or "
                    "a region",
                    chain_.label.text(), chain_.vertices));
  sink.begin(header);
  if (header.wide)
    write_chunks<std::uint64_t>(sink);
  else
    write_chunks<std::uint32_t>(sink);
  sink.finish();
}

}  // namespace isobrick
