#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include <isobrick/estimate.h>
#include <isobrick/extract.h>
#include <isobrick/mesh_filters.h>
#include "io/meshes/levels/level_sink.h"
#include "tools/mesh_output.h"

// What `isobrick extract` reports of each surface.

namespace isobrick::tools {

/// One isosurface to make and where it goes (empty: nowhere).
struct ExtractedSurface {
  ExtractOptions options = {};
  MeshForm form = {};
  std::filesystem::path output, preview;
  MeshFilterOptions filter = {};             ///< of each of them; without a place for scratch files
  std::uint64_t attribute_memory = 0;        ///< that sampling the attributes of the mesh takes
  std::vector<std::string> attributes = {};  ///< their names
};

/// What became of a surface on its way to its file.
struct FilteredSurface {
  MeshSize extracted;                          ///< before the filters that change the mesh
  std::optional<MeshMeasure> measure;          ///< where that was requested
  std::optional<std::uint64_t> simplify_goal;  ///< in triangles, where there is one
  std::vector<WrittenLevel> levels;            ///< of detail, of formats that have them
};

/// What a command reports of its surfaces.
struct CommandOutput {
  nlohmann::ordered_json objects = nlohmann::ordered_json::array(),
                         passes;  ///< of an estimate none
  std::string text;
};

/// Why clearly more triangles are left than a simplification aimed at; empty where they are not.
std::string goal_note(std::uint64_t triangles, const FilteredSurface& filtered,
                      const MeshFilterOptions& filter);

/// What is expected of a surface, for --json and for people.
nlohmann::ordered_json estimate_json(const ExtractedSurface& surface, const ExtractEstimate& e);
std::string estimate_text(const ExtractedSurface& surface, const ExtractEstimate& e);

nlohmann::ordered_json levels_json(const std::vector<WrittenLevel>& levels);

/// What was made; its file has `bytes`.
nlohmann::ordered_json report_json(const ExtractedSurface& surface, const ExtractReport& r,
                                   const FilteredSurface& filtered, std::uint64_t bytes);
/// What its pass took is in the text where it is the `only` surface.
std::string report_text(const ExtractedSurface& surface, const ExtractReport& r,
                        const FilteredSurface& filtered, std::uint64_t bytes, bool only);

/// What was made in one pass over the store.
struct PassReport {
  std::vector<std::string> outputs;
  ExtractReport report;  ///< of any of them
};

/// The passes that made the outputs of these names, which have a report each.
std::vector<PassReport> passes_of(std::span<const ExtractReport> reports,
                                  std::span<const std::string> names);

nlohmann::ordered_json passes_json(std::span<const PassReport> passes);
std::string passes_text(std::span<const PassReport> passes);

}  // namespace isobrick::tools
