#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <isobrick/pieces.h>
#include "tools/attribute_option.h"
#include "tools/extract_report.h"
#include "tools/filter_options.h"
#include "tools/mesh_output.h"
#include "tools/options.h"

namespace isobrick::tools {

/// Pieces, and the mesh file that they become.
struct MergeJob {
  std::vector<std::filesystem::path> pieces;
  std::filesystem::path output;
  MeshForm form;
  MeshFilterOptions filter;
  std::vector<AttributeRequest> attributes;
  ColourRequest colours = {};
  std::uint64_t memory = 0;
  int threads = 0;
  bool normals = true;  ///< false: without those that the pieces have
  bool force = false, no_space_check = false;
};

/// What a merge made.
struct MergeResult {
  PiecesInfo pieces;
  MeshSize size;  ///< of the mesh
  FilteredSurface filtered;
  std::uint64_t bytes = 0;  ///< of the file
  double seconds = 0;
};

/// Makes the mesh, and writes notes of what is odd about it.
MergeResult merge(MergeJob job, Console& console);

}  // namespace isobrick::tools
