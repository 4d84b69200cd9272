#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "isobrick/surface/mesh.h"

namespace isobrick::tools {

/// The files that a mesh can become.
enum class MeshFormat : std::uint8_t { ply, stl };

/// By the name's extension. Throws UsageError for any other.
MeshFormat mesh_format(const std::filesystem::path& path);

std::unique_ptr<MeshSink> open_mesh(const std::filesystem::path& path, bool force);

/// `path` with the isovalue before its extension: mesh.ply → mesh_500.ply.
std::filesystem::path with_isovalue(const std::filesystem::path& path, double isovalue);

}  // namespace isobrick::tools
