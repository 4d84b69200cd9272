#include "pipeline/pieces/piece_reader.h"

#include <utility>

namespace isobrick::inline v0 {

PieceReader::PieceReader(std::shared_ptr<PieceBytes> piece)
    : input_(std::move(piece), PieceKind::surface) {
  std::optional<PieceDescription> header = parse_description(input_.text());
  if (!header) fail("is damaged in its description");
  header_ = std::move(*header);
}

std::vector<PieceTile> PieceReader::neighbours() {
  std::uint64_t count = 0;
  read(std::span(&count, 1));
  if (count != end().neighbours || count > input_.left() / sizeof(PieceTile)) fail("is damaged");
  std::vector<PieceTile> tiles(count);
  read(std::span(tiles));
  return tiles;
}

bool PieceReader::next(PieceTile& tile) {
  if (tiles_ == end().tiles) {
    if (vertices_ != end().vertices || triangles_ != end().triangles) fail("is damaged");
    input_.check_end();
    return false;
  }
  read(std::span(&tile, 1));
  const bool is_next = tiles_ == 0 ? tile.code >= header_.tiles.begin : tile.code > last_code_;
  const std::uint64_t bytes = content_bytes(tile, header_.of_mesh.has_normals);
  if (!is_next || tile.code >= header_.tiles.end || tile.vertices > kMaxTileVertices ||
      tile.triangles > kMaxTileTriangles || bytes > end().largest_tile || bytes > input_.left())
    fail("is damaged");
  ++tiles_;
  vertices_ += tile.vertices;
  triangles_ += tile.triangles;
  last_code_ = tile.code;
  return true;
}

void PieceReader::skip(const PieceTile& tile) {
  input_.skip(content_bytes(tile, header_.of_mesh.has_normals));
}

}  // namespace isobrick
