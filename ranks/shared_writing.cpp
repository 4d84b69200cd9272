#include "ranks/shared_writing.h"

namespace isobrick::inline v0 {

void PlacedTiles::read(PieceReader& reader, const PieceTile& tile, const PiecePlace& place,
                       std::uint64_t own) {
  positions_.resize(tile.vertices);
  reader.read(std::span(positions_));
  normals_.resize(has_normals_ ? tile.vertices : 0);
  reader.read(std::span(normals_));
  triangles_.resize(tile.triangles);
  reader.read(std::span(triangles_));
  wide_triangles_.resize(wide_ ? tile.triangles : 0);
  const std::uint64_t first = place.before.vertices;
  if (!(wide_ ? place.numbers.renumber(triangles_, first, own, wide_triangles_)
              : place.numbers.renumber(triangles_, first, own)))
    reader.fail("is damaged: a triangle names a vertex that is not there");
}

std::uint64_t bytes_of(std::span<const OwnPiece> pieces) {
  std::uint64_t bytes = 0;
  for (const OwnPiece& piece : pieces) bytes += piece.bytes->size();
  return bytes;
}

std::string text_from_first(Ranks& ranks, const std::string& own) {
  const Ranks::Bytes text = from_first(ranks, std::as_bytes(std::span(own)));
  return {reinterpret_cast<const char*>(text.data()), text.size()};
}

}  // namespace isobrick
