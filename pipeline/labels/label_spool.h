#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <isobrick/lattice.h>
#include <isobrick/scalar.h>
#include "io/bytes/output_file.h"
#include "surface/labels/label_key.h"
#include "surface/labels/label_piece.h"

namespace isobrick::inline v0 {

/// The pieces of one label in the spool, and what they are together.
struct LabelChain {
  Label label;
  std::uint64_t last = 0;  ///< place of the piece that was appended last
  std::uint64_t vertices = 0, quads = 0;
  Int3 first_tile, last_tile;  ///< bounds of the tiles with a piece
};

/// A piece as it was read back.
struct SpooledPiece {
  std::uint64_t previous = 0;  ///< place of the piece that was appended before; kNoPiece: none
  Int3 tile;
  std::vector<LabelVertex> vertices;
  std::vector<ForeignVertex> foreign;
  std::vector<LabelQuad> quads;
};

/// Pieces of labels in a nameless file. Each names the one of the same label before it, so a label
/// is read from its last piece to its first, and the memory is that of one LabelChain a label.
class LabelSpool {
 public:
  static constexpr std::uint64_t kNoPiece = ~std::uint64_t{0};

  /// The file lies beside `beside`; "-": in the folder of temporary files.
  /// Labels are of an image of this type.
  LabelSpool(const std::string& beside, ScalarType type)
      : type_(type), writer_(open_scratch_beside(beside)) {}

  /// The pieces of a tile as append() takes them: a LabelRecord with its items for each.
  /// Thread-safe.
  static std::vector<std::byte> pack(Int3 tile, std::span<const LabelPiece> pieces);
  /// Appends pieces of tiles, which come in Morton order.
  void append(std::span<const std::byte> packed);
  /// Nothing is appended any more. The labels in ascending order.
  std::vector<LabelChain> finish();

  /// Reads a piece, after finish(). Thread-safe.
  void read(std::uint64_t place, SpooledPiece& piece) const;

  std::uint64_t labels() const { return chain_of_.size(); }
  /// Bytes that the labels take in memory.
  std::uint64_t memory() const {
    return chain_of_.size() * 4 * (sizeof(LabelKey) + sizeof(LabelChain));
  }
  std::uint64_t bytes() const { return writer_.size(); }
  /// Bytes that the pieces of a tile take at most, packed.
  static std::uint64_t max_packed_bytes();

 private:
  ScalarType type_;
  FileWriter writer_;
  File file_;
  FlatMap<LabelChain, LabelKey> chain_of_;
};

}  // namespace isobrick
