#pragma once

#include <filesystem>

namespace isobrick {

/// Whether a file goes by the extension of a mesh, of any format that we write.
bool has_mesh_name(const std::filesystem::path& file);

}  // namespace isobrick
