#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "isobrick/pipeline/extract.h"

namespace isobrick::tools {

/// The files that a mesh can become.
enum class MeshFormat : std::uint8_t { ply, stl };

/// By the name's extension. Throws UsageError for any other.
MeshFormat mesh_format(const std::filesystem::path& path);

std::unique_ptr<MeshSink> open_mesh(const std::filesystem::path& path, bool force);

/// What a mesh of this size takes on disk.
struct MeshBytes {
  std::uint64_t file = 0;    ///< the finished file
  std::uint64_t needed = 0;  ///< at the worst moment, scratch file included
};
MeshBytes predict_bytes(MeshFormat format, bool normals, const ExtractEstimate& estimate);

/// `path` with the isovalue before its extension: mesh.ply → mesh_500.ply.
std::filesystem::path with_isovalue(const std::filesystem::path& path, double isovalue);

/// Bytes free on the disk that `path` will be written to.
std::uint64_t free_space(const std::filesystem::path& path);

}  // namespace isobrick::tools
