#pragma once

#include <filesystem>
#include <string>

namespace isobrick::inline v0 {

/// Whether a file goes by the extension of a mesh, of any format that is read and drawn.
bool has_mesh_name(const std::filesystem::path& file);

/// These extensions for messages: ".ply, .stl, … or .pvtp".
std::string mesh_extensions();

}  // namespace isobrick
