#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "isobrick/surface/mesh.h"

namespace isobrick::tools {

/// The files that a mesh can become.
enum class MeshFormat : std::uint8_t { ply, stl, obj, glb, vtp, pvtp };

/// How a mesh is written, as far as its size depends on it.
struct MeshForm {
  MeshFormat format = MeshFormat::ply;
  bool normals = false;
  bool quantize = false;  ///< 16 bits a number; GLB only
};

/// "PLY".
std::string_view name_of(MeshFormat format);

/// Whether a mesh of this format has normals at its vertices. An STL has them at facets only.
bool has_normals(MeshFormat format);
/// Whether its triangles share vertices, so that it has a number of them.
bool has_vertices(MeshFormat format);

/// By the name's extension. Throws UsageError for any other.
MeshFormat mesh_format(const std::filesystem::path& path);
/// Throws UsageError where the name says another format than `format`, or standard output where
/// that cannot be streamed.
void check_mesh_name(const std::filesystem::path& path, MeshFormat format);
/// By its name in lower case.
MeshFormat parse_mesh_format(const std::string& text);

/// `threads` may help to write, 0: all cores; `memory` is the budget of the whole command.
/// Throws what the format's sink does.
std::unique_ptr<MeshSink> open_mesh(const std::filesystem::path& path, const MeshForm& form,
                                    bool force, int threads, std::uint64_t memory);

/// What MeshSink::memory() of such a mesh is.
std::uint64_t mesh_memory(MeshFormat format, int threads, std::uint64_t memory);

/// Bytes of a finished mesh, its parts included.
std::uint64_t mesh_bytes(const std::filesystem::path& path);

/// `path` with the isovalue before its extension: mesh.ply → mesh_500.ply.
std::filesystem::path with_isovalue(const std::filesystem::path& path, double isovalue);

}  // namespace isobrick::tools
