#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "pipeline/pieces/piece_bytes.h"
#include "pipeline/pieces/piece_format.h"

namespace isobrick::inline v0 {

/// Reads a piece from its beginning to its end, in a buffer of kBuffer bytes.
class PieceReader {
 public:
  static constexpr std::size_t kBuffer = std::size_t{256} << 10;

  /// Reads header and end. Throws UsageError where there is no piece of a version that this program
  /// knows, DamageError for one that shows damage.
  explicit PieceReader(std::shared_ptr<PieceBytes> piece);
  /// The same of a file. Throws Error where there is none.
  explicit PieceReader(const std::filesystem::path& path)
      : PieceReader(std::shared_ptr<PieceBytes>(open_piece_file(path))) {}

  const PieceDescription& header() const { return header_; }
  const std::string& header_text() const { return text_; }
  const PieceEnd& end() const { return end_; }

  /// The tiles before the part; once, before the first next().
  std::vector<PieceTile> neighbours();
  /// The next tile of the part; false at the end, where the checksum is compared unless tiles were
  /// passed over.
  bool next(PieceTile& tile);
  /// Fills what belongs to the tile, in the order of the piece.
  template <class T>
  void read(std::span<T> items) {
    read_bytes(std::as_writable_bytes(items));
  }
  /// Passes over what belongs to the tile.
  void skip(const PieceTile& tile);
  /// Reads the rest. Throws DamageError.
  void verify();

  /// What is wrong with the piece and what to do.
  [[noreturn]] void fail(const std::string& what) const;

 private:
  void read_bytes(std::span<std::byte> bytes);
  std::uint64_t left() const { return end_.bytes - sizeof end_ - at_; }

  std::shared_ptr<PieceBytes> piece_;
  std::string text_;
  PieceDescription header_;
  PieceEnd end_;
  std::uint64_t at_ = 0;  ///< bytes that were handed out
  std::uint32_t crc_ = 0;
  std::uint64_t tiles_ = 0, vertices_ = 0, triangles_ = 0, last_code_ = 0;  ///< so far
  std::vector<std::byte> buffer_;
  std::size_t begin_ = 0, filled_ = 0;  ///< of the buffer
  bool skips_ = false;
};

/// Whether a file begins as a piece does, or has no byte.
bool looks_like_piece(const std::filesystem::path& path);

}  // namespace isobrick
