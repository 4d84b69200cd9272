#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include <isobrick/mesh_file_sink.h>

namespace isobrick::tools {

/// How a mesh is written, as far as its size depends on it.
struct MeshForm {
  MeshFormat format = MeshFormat::ply;
  bool normals = false;
  bool quantize = false;       ///< 16 bits a number; GLB only
  bool compress = false;       ///< GLB and 3D Tiles only
  int levels = 0;              ///< of detail; 0: by the mesh
  bool sharded = false;        ///< neuroglancer only
  std::size_t attributes = 0;  ///< a float each at a vertex
  bool colours = false;        ///< of vertices; PLY and GLB only
};

/// By the name's extension; PLY on standard output. Throws UsageError for any other.
MeshFormat mesh_format(const std::filesystem::path& path);
/// By a word such as "ply". Throws UsageError for any other.
MeshFormat parse_mesh_format(const std::string& text);

/// What the file of such a mesh holds of a budget; see MeshSink::memory().
std::uint64_t memory_of_file(const MeshForm& form, int threads, std::uint64_t memory);

/// Throws UsageError for a compression that the format has not.
void check_compression(const MeshForm& form);
/// Throws UsageError for levels of detail and shards that the format has not.
void check_levels(const MeshForm& form);

/// `form` with the format that is named, or that of the output's name; neither of them may be
/// there. Throws UsageError for a name or a part of the form that does not fit the format.
MeshForm with_format(MeshForm form, const std::optional<MeshFormat>& named,
                     const std::filesystem::path& output);

/// Throws as check_can_write(), and for a folder where it exists and `force` is not set.
void check_can_write_mesh(const std::filesystem::path& path, MeshFormat format, bool force);

/// "auto" (0) or a number of levels of detail. Throws UsageError for any other.
int parse_detail_levels(const std::string& text);

/// Bytes of a finished mesh, its parts included.
std::uint64_t mesh_bytes(const std::filesystem::path& path);

/// `path` with the isovalue before its extension: mesh.ply → mesh_500.ply.
std::filesystem::path with_isovalue(const std::filesystem::path& path, double isovalue);

}  // namespace isobrick::tools
