#include "ranks/piece_places.h"

#include <algorithm>

#include <isobrick/error.h>
#include "pipeline/pieces/open_tiles.h"
#include "pipeline/pieces/piece_reader.h"

namespace isobrick::inline v0 {
namespace {

/// What all ranks learn of a piece.
struct PieceSize {
  std::uint64_t number, vertices, triangles;
};

/// Where a part is, and where it goes.
struct PartPlace {
  std::size_t rank = 0;
  MeshSize before;
};

/// A tile of an own piece that later parts may name vertices of.
struct OpenTile {
  std::uint64_t code;
  std::uint32_t first, vertices;  ///< counted from the piece's own
};

/// An own piece, as far as its place follows from it.
struct ScannedPiece {
  PieceSize size;
  std::vector<PieceTile> neighbours;
  std::vector<OpenTile> open;  ///< in the order of their codes
};

ScannedPiece scan(const OwnPiece& piece, const PartPlans& parts) {
  PieceReader reader(piece.bytes);
  ScannedPiece scanned;
  scanned.size = {piece.number, reader.end().vertices, reader.end().triangles};
  scanned.neighbours = reader.neighbours();
  const std::uint64_t end = parts.tiles(piece.number).end;
  std::uint32_t vertices = 0;
  for (PieceTile tile; reader.next(tile); reader.skip(tile)) {
    if (tile.vertices > 0 && last_asker(tile.code, parts.grid) >= end)
      scanned.open.push_back({tile.code, vertices, tile.vertices});
    vertices += tile.vertices;
  }
  return scanned;
}

/// Collective: the places of all parts.
std::vector<PartPlace> place_parts(Ranks& ranks, std::uint32_t count,
                                   std::span<const ScannedPiece> pieces, MeshSize& mesh) {
  std::vector<PieceSize> own;
  for (const ScannedPiece& piece : pieces) own.push_back(piece.size);
  const auto all = ranks.gather(std::as_bytes(std::span(own)));
  std::vector<PartPlace> parts(count);
  std::vector<PieceSize> sizes(count);
  for (std::size_t rank = 0; rank < all.size(); ++rank)
    for (const PieceSize& size : to_items<PieceSize>(all[rank])) {
      parts.at(size.number - 1).rank = rank;
      sizes.at(size.number - 1) = size;
    }
  for (std::uint32_t i = 0; i < count; ++i) {
    if (sizes[i].number != i + 1) throw Error("a part of the mesh was made by no rank");
    parts[i].before = mesh;
    mesh.vertices += sizes[i].vertices;
    mesh.triangles += sizes[i].triangles;
  }
  return parts;
}

/// What this rank's pieces say of tiles that others ask for: no vertices of one that is not there.
std::vector<OpenTile> answer(std::span<const ScannedPiece> pieces, const PartPlans& parts,
                             std::span<const std::uint64_t> codes) {
  std::vector<OpenTile> answers;
  for (const std::uint64_t code : codes) {
    OpenTile found{code, 0, 0};
    const std::uint32_t part = parts.part_of(code);
    for (const ScannedPiece& piece : pieces) {
      if (piece.size.number != part) continue;
      const auto at = std::lower_bound(
          piece.open.begin(), piece.open.end(), code,
          [](const OpenTile& tile, std::uint64_t wanted) { return tile.code < wanted; });
      if (at != piece.open.end() && at->code == code) found = *at;
    }
    answers.push_back(found);
  }
  return answers;
}

/// Collective: the tiles that the pieces of this rank name, by the rank that made them, in the
/// order of pieces and neighbours.
std::vector<std::vector<OpenTile>> ask(Ranks& ranks, const PartPlans& parts,
                                       std::span<const PartPlace> places,
                                       std::span<const ScannedPiece> pieces) {
  std::vector<std::vector<std::uint64_t>> codes(static_cast<std::size_t>(ranks.size()));
  for (const ScannedPiece& piece : pieces)
    for (const PieceTile& tile : piece.neighbours)
      codes[places[parts.part_of(tile.code) - 1].rank].push_back(tile.code);
  std::vector<Ranks::Bytes> out;
  for (const auto& to : codes) out.push_back(to_bytes(std::span<const std::uint64_t>(to)));
  std::vector<Ranks::Bytes> answers;
  for (const Ranks::Bytes& asked : ranks.exchange(out)) {
    const std::vector<OpenTile> tiles = answer(pieces, parts, to_items<std::uint64_t>(asked));
    answers.push_back(to_bytes(std::span<const OpenTile>(tiles)));
  }
  std::vector<std::vector<OpenTile>> tiles;
  for (const Ranks::Bytes& got : ranks.exchange(answers)) tiles.push_back(to_items<OpenTile>(got));
  return tiles;
}

}  // namespace

PiecePlaces find_places(Ranks& ranks, const PartPlans& parts, std::span<const OwnPiece> pieces) {
  std::vector<ScannedPiece> scanned;
  for (const OwnPiece& piece : pieces) scanned.push_back(scan(piece, parts));
  PiecePlaces result;
  const std::vector<PartPlace> places = place_parts(ranks, parts.count(), scanned, result.mesh);
  const auto tiles = ask(ranks, parts, places, scanned);
  std::vector<std::size_t> taken(tiles.size());
  for (std::size_t i = 0; i < scanned.size(); ++i) {
    PiecePlace& place = result.own.emplace_back();
    place.before = places[pieces[i].number - 1].before;
    for (const PieceTile& neighbour : scanned[i].neighbours) {
      const PartPlace& part = places[parts.part_of(neighbour.code) - 1];
      const OpenTile& tile = tiles[part.rank].at(taken[part.rank]++);
      if (tile.vertices != neighbour.vertices)
        PieceReader(pieces[i].bytes).fail("does not fit the pieces before it");
      place.numbers.add(tile.vertices, part.before.vertices + tile.first);
    }
  }
  return result;
}

}  // namespace isobrick
