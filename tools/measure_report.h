#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include <isobrick/mesh_filters.h>

// What --measure reports, for --json and for people.
namespace isobrick::tools {

nlohmann::ordered_json measure_json(const MeshMeasure& measure);
std::string measure_text(const MeshMeasure& measure);

}  // namespace isobrick::tools
