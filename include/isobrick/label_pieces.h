#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <string>

#include <isobrick/api.h>
#include <isobrick/label_properties.h>
#include <isobrick/labels.h>
#include <isobrick/part.h>

// Meshes of labels that many tasks make: each a piece with what the tiles of a part have of all
// labels, a file of its own, which needs none of the others. merge_label_pieces() makes the meshes
// of extract_labels() from them, byte for byte.

namespace isobrick::inline v0 {

/// What became of a piece of labels.
struct LabelPieceReport {
  LabelReport pass;         ///< without `labels`; of a piece that was there only the sizes
  bool is_kept = false;     ///< it was there, whole and of the same meshes
  std::uint64_t bytes = 0;  ///< of its file
};

/// Makes what a part has of all labels and writes it to the piece `path`, which has its name once
/// it is whole. The parts have about as many blocks that a label's boundary may pass through; a
/// part may be empty. Memory does not grow with the number of labels.
///
/// `options.visits` and `scratch_beside` do not matter. What becomes of a file that is there:
/// extract_piece(). Throws as extract_labels() does, but not for a label that is not there.
ISOBRICK_API LabelPieceReport extract_label_piece(const StoreReader& store,
                                                  const LabelOptions& options, Part part,
                                                  const std::filesystem::path& path,
                                                  bool force = false,
                                                  Progress& progress = no_progress());

/// What pieces of labels will become, from their beginnings and ends.
struct LabelPiecesInfo {
  std::string name;                  ///< StoreInfo::name of the first part's store
  int level = 0;                     ///< of the store
  std::string unit;                  ///< of the meshes, or empty
  std::optional<LabelTable> labels;  ///< StoreInfo::labels
  MeshSize size;                     ///< of all meshes
  std::uint64_t bytes = 0;           ///< of all pieces
  std::uint64_t merge_memory = 0;    ///< the least LabelMergeOptions::memory
};

/// Whether a file is a piece of labels. Throws Error where it cannot be read.
ISOBRICK_API bool is_label_piece(const std::filesystem::path& path);

/// Checks that `pieces` are all parts of the same labels, each once, in any order. Throws as
/// read_pieces() does.
ISOBRICK_API LabelPiecesInfo read_label_pieces(std::span<const std::filesystem::path> pieces);

/// How pieces of labels are put together; as in LabelOptions.
struct LabelMergeOptions {
  /// Hard budget until meshes are passed on, bytes. Then a quarter is still taken at most.
  std::uint64_t memory = std::uint64_t{1} << 30;
  int threads = 0;                             ///< 0: all cores
  int visits = 0;                              ///< meshes at the same time; 0: as many as threads
  std::filesystem::path scratch_beside = "-";  ///< where the scratch file lies
  std::stop_token cancel = {};                 ///< ends the operation with Cancelled
  std::function<void(const LabelTotals&)> check_totals = {};  ///< called before the first mesh
};

/// Puts the pieces together and calls `visit` as extract_labels() does, with the same meshes.
/// Pieces are read once, before the first mesh; a scratch file takes as many bytes. Throws as
/// read_label_pieces() does, DamageError for a piece that turns out damaged, UsageError for a label
/// that was named and not there, and for a budget too small.
ISOBRICK_API LabelReport merge_label_pieces(std::span<const std::filesystem::path> pieces,
                                            const LabelMergeOptions& options,
                                            const LabelVisitor& visit,
                                            Progress& progress = no_progress());

}  // namespace isobrick
