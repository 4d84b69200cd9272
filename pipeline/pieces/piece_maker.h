#pragma once

#include <cstdint>
#include <filesystem>

#include <nlohmann/json.hpp>

#include <isobrick/pieces.h>
#include "io/bytes/output_file.h"
#include "pipeline/extract/extract_plan.h"
#include "pipeline/pieces/part_plan.h"
#include "pipeline/pieces/piece_format.h"

namespace isobrick::inline v0 {

/// Makes pieces of one mesh: what extract_piece() does, with one plan for all of them.
class PieceMaker {
 public:
  /// Plans so many parts, which reads the ranges of the whole volume. Throws as extract_piece()
  /// does.
  static PartPlans plan(const StoreReader& store, const ExtractOptions& options,
                        std::uint32_t parts);
  /// By plan() of the same surface. The store must outlive it. Throws as extract_piece() does.
  PieceMaker(const StoreReader& store, const ExtractOptions& options, PartPlans plans);

  const PartPlans& parts() const { return plans_; }
  /// Of the whole mesh.
  const MeshHeader& header() const { return header_; }
  /// Part `number`, from 1.
  PieceReport make(std::uint32_t number, const std::filesystem::path& path, bool force,
                   Progress& progress) const;
  /// The same part, appended to `out`, which is empty.
  PieceReport append(std::uint32_t number, FileWriter& out, Progress& progress) const;

 private:
  PieceDescription describe(std::uint32_t number) const;

  const StoreReader& store_;
  ExtractOptions options_;
  PartPlans plans_;
  MeshHeader header_;
  nlohmann::json mesh_;
};

}  // namespace isobrick
