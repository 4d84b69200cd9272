#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pipeline/pieces/piece_bytes.h"
#include "pipeline/pieces/piece_format.h"

namespace isobrick::inline v0 {

/// Reads the bytes of a piece of either kind, from its beginning to its end, in a buffer of kBuffer
/// bytes.
class PieceInput {
 public:
  static constexpr std::size_t kBuffer = std::size_t{256} << 10;

  /// Reads description and end. Throws UsageError where there is no piece of that kind and of a
  /// version that this program knows, DamageError for one that shows damage.
  PieceInput(std::shared_ptr<PieceBytes> piece, PieceKind kind);

  /// Of the description.
  const std::string& text() const { return text_; }
  const PieceEnd& end() const { return end_; }
  /// Bytes before the end that were not read.
  std::uint64_t left() const { return end_.bytes - sizeof end_ - at_; }

  /// Fills items with what comes next. Throws DamageError where there is less.
  template <class T>
  void read(std::span<T> items) {
    read_bytes(std::as_writable_bytes(items));
  }
  /// Passes over what comes next; then there is no checksum to compare.
  void skip(std::uint64_t bytes);
  /// All was read. Throws DamageError where that is not so, or the checksum is another.
  void check_end() const;
  /// Reads the rest. Throws DamageError.
  void verify();

  /// What is wrong with the piece and what to do.
  [[noreturn]] void fail(const std::string& what) const;

 private:
  void read_bytes(std::span<std::byte> bytes);

  std::shared_ptr<PieceBytes> piece_;
  std::string text_;
  PieceEnd end_;
  std::uint64_t at_ = 0;  ///< bytes that were handed out
  std::uint32_t crc_ = 0;
  std::vector<std::byte> buffer_;
  std::size_t begin_ = 0, filled_ = 0;  ///< of the buffer
  bool skips_ = false;
};

/// Throws UsageError for standard output.
void check_piece_name(const std::filesystem::path& path);

/// What the piece of this file is one of; nothing where it is none.
std::optional<PieceKind> find_piece_kind(const std::filesystem::path& path);

/// What the piece there holds, where it is whole and has the description `text`; nothing where it
/// is to be made. Throws UsageError where it is no piece and must stay.
std::optional<PieceEnd> find_piece(const std::filesystem::path& path, PieceKind kind,
                                   const std::string& text, bool force);

}  // namespace isobrick
