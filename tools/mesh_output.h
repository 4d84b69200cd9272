#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include <isobrick/mesh_file_sink.h>

namespace isobrick::tools {

/// How a mesh is written, as far as its size depends on it.
struct MeshForm {
  MeshFormat format = MeshFormat::ply;
  bool normals = false;
  bool quantize = false;       ///< 16 bits a number; GLB only
  std::size_t attributes = 0;  ///< a float each at a vertex
};

/// By the name's extension; PLY on standard output. Throws UsageError for any other.
MeshFormat mesh_format(const std::filesystem::path& path);
/// Throws UsageError where the name has the extension of another format, or standard output where
/// that has several files.
void check_mesh_name(const std::filesystem::path& path, MeshFormat format);
/// By a word such as "ply". Throws UsageError for any other.
MeshFormat parse_mesh_format(const std::string& text);

/// Bytes of a finished mesh, its parts included.
std::uint64_t mesh_bytes(const std::filesystem::path& path);

/// `path` with the isovalue before its extension: mesh.ply → mesh_500.ply.
std::filesystem::path with_isovalue(const std::filesystem::path& path, double isovalue);

}  // namespace isobrick::tools
