#pragma once

#include <isobrick/label_pieces.h>
#include "pipeline/labels/label_piece_format.h"
#include "pipeline/pieces/part_plan.h"

namespace isobrick::inline v0 {

/// Makes pieces of the same labels: what extract_label_piece() does, with one plan for all of them.
class LabelPieceMaker {
 public:
  /// Plans so many parts, which reads the ranges of the whole volume. Throws as
  /// extract_label_piece() does.
  static PartPlans plan(const StoreReader& store, const LabelOptions& options, std::uint32_t parts);
  /// By plan() of the same options. The store must outlive it. Throws as extract_label_piece()
  /// does.
  LabelPieceMaker(const StoreReader& store, const LabelOptions& options, PartPlans plans);

  /// Part `number`, from 1.
  LabelPieceReport make(std::uint32_t number, const std::filesystem::path& path, bool force,
                        Progress& progress) const;

 private:
  StoreReader store_;
  LabelOptions options_;
  PartPlans plans_;
  LabelImage image_;
  nlohmann::json mesh_;
};

}  // namespace isobrick
