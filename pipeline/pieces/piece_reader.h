#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "pipeline/pieces/piece_input.h"

namespace isobrick::inline v0 {

/// Reads a piece of a surface, from its beginning to its end.
class PieceReader {
 public:
  static constexpr std::size_t kBuffer = PieceInput::kBuffer;

  /// Reads header and end. Throws as PieceInput does.
  explicit PieceReader(std::shared_ptr<PieceBytes> piece);
  /// The same of a file. Throws Error where there is none.
  explicit PieceReader(const std::filesystem::path& path)
      : PieceReader(std::shared_ptr<PieceBytes>(open_piece_file(path))) {}

  const PieceDescription& header() const { return header_; }
  const PieceEnd& end() const { return input_.end(); }

  /// The tiles before the part; once, before the first next().
  std::vector<PieceTile> neighbours();
  /// The next tile of the part; false at the end, where the checksum is compared unless tiles were
  /// passed over.
  bool next(PieceTile& tile);
  /// Fills what belongs to the tile, in the order of the piece.
  template <class T>
  void read(std::span<T> items) {
    input_.read(items);
  }
  /// Passes over what belongs to the tile.
  void skip(const PieceTile& tile);

  [[noreturn]] void fail(const std::string& what) const { input_.fail(what); }

 private:
  PieceInput input_;
  PieceDescription header_;
  std::uint64_t tiles_ = 0, vertices_ = 0, triangles_ = 0, last_code_ = 0;  ///< so far
};

}  // namespace isobrick
