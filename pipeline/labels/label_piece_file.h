#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "io/bytes/output_file.h"
#include "pipeline/labels/label_piece_format.h"
#include "pipeline/pieces/piece_input.h"

namespace isobrick::inline v0 {

/// Writes a piece of labels.
class LabelPieceWriter {
 public:
  /// Appends to `out`, which must outlive it.
  LabelPieceWriter(FileWriter& out, const LabelPieceDescription& description);

  /// The pieces of tiles that follow those before, as LabelSpool::pack() packs them.
  void append(std::span<const std::byte> packed);
  /// What the piece ends with.
  const PieceEnd& finish();

 private:
  void write(std::span<const std::byte> bytes);

  FileWriter& out_;
  PieceEnd end_;
};

/// Reads a piece of labels from its beginning to its end.
class LabelPieceReader {
 public:
  /// Reads description and end. Throws as PieceInput does.
  explicit LabelPieceReader(const std::filesystem::path& path);

  const LabelPieceDescription& description() const { return description_; }
  const PieceEnd& end() const { return input_.end(); }

  /// What a tile has of a label, as LabelSpool::append() takes it, until the next call; empty at
  /// the end, where the checksum is compared. Throws DamageError.
  std::span<const std::byte> next();

  [[noreturn]] void fail(const std::string& what) const { input_.fail(what); }

 private:
  PieceInput input_;
  LabelPieceDescription description_;
  std::uint64_t records_ = 0, vertices_ = 0, triangles_ = 0, last_tile_ = 0;  ///< so far
  std::vector<std::byte> record_;
};

}  // namespace isobrick
