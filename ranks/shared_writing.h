#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include <isobrick/mesh.h>
#include <isobrick/progress.h>
#include "io/meshes/vertex_rows.h"
#include "pipeline/pieces/piece_reader.h"
#include "ranks/piece_places.h"
#include "ranks/ranks.h"

// How ranks write their pieces into files that all of them share.

namespace isobrick::inline v0 {

/// Bytes that follow each other in a file of all ranks.
class RunWriter {
 public:
  static constexpr std::size_t kBuffer = std::size_t{4} << 20;

  RunWriter(SharedFile& file, std::uint64_t offset) : file_(file), offset_(offset) {
    buffer_.reserve(kBuffer);
  }

  /// Room for so many bytes, at most kBuffer.
  std::byte* append(std::size_t bytes) {
    if (buffer_.size() + bytes > kBuffer) flush();
    buffer_.resize(buffer_.size() + bytes);
    return buffer_.data() + buffer_.size() - bytes;
  }

  void flush() {
    file_.write_at(offset_, buffer_);
    offset_ += buffer_.size();
    buffer_.clear();
  }

 private:
  SharedFile& file_;
  std::uint64_t offset_;
  std::vector<std::byte> buffer_;
};

/// Appends vertices as append_rows() does; `normals` is empty or has one for each.
inline void append_rows(RunWriter& out, std::span<const Vec3f> positions,
                        std::span<const Vec3f> normals) {
  const std::size_t row = row_bytes(!normals.empty());
  for (std::size_t i = 0; i < positions.size(); ++i) {
    std::byte* const to = out.append(row);
    std::memcpy(to, &positions[i], sizeof(Vec3f));
    if (!normals.empty()) std::memcpy(to + sizeof(Vec3f), &normals[i], sizeof(Vec3f));
  }
}

/// A tile of a piece, with the numbers that its vertices have in the mesh.
struct PlacedTile {
  std::span<const Vec3f> positions, normals;  ///< no normals where the mesh has none
  std::span<const Triangle> triangles;
  std::span<const WideTriangle> wide_triangles;  ///< in their place, see MeshHeader::wide
};

/// Reads the tiles of pieces and gives their vertices the numbers of the mesh.
class PlacedTiles {
 public:
  explicit PlacedTiles(const MeshHeader& header)
      : has_normals_(header.has_normals), wide_(header.wide) {}

  /// Calls take(tile) for each tile, in order, and reports progress in bytes of the piece. Throws
  /// as PieceReader does.
  template <class Take>
  void for_each(const OwnPiece& piece, const PiecePlace& place, Progress& progress, Take&& take) {
    PieceReader reader(piece.bytes);
    reader.neighbours();
    std::uint64_t own = 0;
    for (PieceTile tile; reader.next(tile);) {
      own += tile.vertices;
      read(reader, tile, place, own);
      take(PlacedTile{positions_, normals_,
                      wide_ ? std::span<const Triangle>() : std::span<const Triangle>(triangles_),
                      wide_triangles_});
      progress.advance(content_bytes(tile, has_normals_));
    }
  }

 private:
  /// `own`: vertices of the piece up to the end of this tile.
  void read(PieceReader& reader, const PieceTile& tile, const PiecePlace& place, std::uint64_t own);

  bool has_normals_, wide_;
  std::vector<Vec3f> positions_, normals_;
  std::vector<Triangle> triangles_;
  std::vector<WideTriangle> wide_triangles_;
};

/// Bytes of all these pieces.
std::uint64_t bytes_of(std::span<const OwnPiece> pieces);

/// Collective: the text that rank 0 gives.
std::string text_from_first(Ranks& ranks, const std::string& own);

}  // namespace isobrick
