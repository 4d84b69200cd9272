#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "pipeline/pieces/piece_format.h"

namespace isobrick::inline v0 {

/// The pieces of one mesh, in the order of their parts, and what they have together.
struct PieceSet {
  struct Piece {
    std::filesystem::path path;
    Part part;
    TileRange tiles;
    std::uint64_t bytes = 0;
    std::uint32_t content_crc32c = 0;

    /// Whether the piece is still what it was.
    bool is_same(const PieceEnd& end) const {
      return end.bytes == bytes && end.content_crc32c == content_crc32c;
    }
  };
  std::vector<Piece> pieces;
  std::uint64_t vertices = 0, triangles = 0, bytes = 0;
  std::uint64_t largest_tile = 0;  ///< PieceEnd::largest_tile

  std::uint64_t memory() const;  ///< that the list takes
};

/// Collects the pieces of a mesh, in any order.
class PieceCollector {
 public:
  /// Throws UsageError where there are none.
  explicit PieceCollector(std::span<const std::filesystem::path> paths);

  /// The next piece, in the order of `paths`. Throws UsageError where it is one of another mesh.
  void add(const PieceKey& key, const PieceEnd& end);
  /// Throws UsageError where a part is missing, or there twice.
  PieceSet collected() &&;

 private:
  void check_parts() const;

  std::span<const std::filesystem::path> paths_;
  PieceKey first_;
  PieceSet set_;
};

}  // namespace isobrick
