#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

#include "isobrick/pipeline/estimate.h"
#include "isobrick/pipeline/extract.h"
#include "tools/mesh_output.h"

// What `isobrick extract` says of each surface.

namespace isobrick::tools {

/// One isosurface to make and where it goes (empty: nowhere).
struct ExtractedSurface {
  ExtractOptions options;
  MeshForm form;
  std::filesystem::path output, preview;
};

/// What is expected of a surface, for --json and for people.
nlohmann::ordered_json estimate_json(const ExtractedSurface& surface, const ExtractEstimate& e);
std::string estimate_text(const ExtractedSurface& surface, const ExtractEstimate& e);

/// What was made; its file has `bytes`.
nlohmann::ordered_json report_json(const ExtractedSurface& surface, const ExtractReport& r,
                                   std::uint64_t bytes);
std::string report_text(const ExtractedSurface& surface, const ExtractReport& r,
                        std::uint64_t bytes);

}  // namespace isobrick::tools
