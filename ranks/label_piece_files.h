#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include <isobrick/label_pieces.h>
#include "pipeline/pieces/part_plan.h"
#include "ranks/ranks.h"

namespace isobrick::inline v0 {

/// Pieces of labels, of all parts.
struct LabelPieceFiles {
  std::vector<std::filesystem::path> paths;
  std::uint64_t kept = 0;  ///< that were there
  LabelReport pass;        ///< what all of them took, but for seconds
};

/// Collective, or of this process where `ranks` is null: makes the pieces in `folder`, which is
/// there. Each is made by the rank that gets it; those that are whole are kept. `plan` is
/// LabelPieceMaker::plan(), which one rank calls. Throws as extract_label_piece() does.
LabelPieceFiles make_label_pieces(Ranks* ranks, const StoreReader& store,
                                  const LabelOptions& options,
                                  const std::function<PartPlans()>& plan,
                                  const std::filesystem::path& folder, Progress& progress);

}  // namespace isobrick
