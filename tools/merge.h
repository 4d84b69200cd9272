#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include <isobrick/pieces.h>
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
  std::uint64_t memory = 0;
  int threads = 0;
  bool force = false, no_space_check = false;
};

/// What a merge reports: members of a JSON object, and a text.
struct MergeResult {
  nlohmann::ordered_json object;
  std::string text;
};

/// Makes the mesh.
MergeResult merge(MergeJob job, Console& console);

}  // namespace isobrick::tools
