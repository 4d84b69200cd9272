#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string_view>

#include <isobrick/api.h>
#include <isobrick/mesh.h>

namespace isobrick::inline v0 {

/// The files that a mesh can become; of neuroglancer and 3D Tiles a folder of levels of detail.
enum class MeshFormat : std::uint8_t { ply, stl, obj, glb, vtp, pvtp, neuroglancer, tiles3d };

/// The format's name for people: "PLY".
ISOBRICK_API std::string_view name_of(MeshFormat format);

/// The usual extension of its files: ".ply".
ISOBRICK_API std::string_view extension_of(MeshFormat format);

/// The format of files with an extension such as ".ply" (or ".PLY"); nullopt for any other.
ISOBRICK_API std::optional<MeshFormat> find_mesh_format(std::string_view extension);

/// Whether a mesh of this format has normals at its vertices. An STL has them at facets only.
ISOBRICK_API bool has_normals(MeshFormat format);
/// Whether its triangles share vertices, so that it has a number of them.
ISOBRICK_API bool has_vertices(MeshFormat format);
/// Whether it holds MeshChunk::attributes: PLY, GLB, VTP and PVTP do. Others ignore them.
ISOBRICK_API bool has_attributes(MeshFormat format);
/// Whether it holds meshes of more vertices than 32 bits number (MeshHeader::wide): all but PLY and
/// STL do.
ISOBRICK_API bool takes_wide(MeshFormat format);
/// Whether it is a folder with the mesh at several levels of detail: neuroglancer and 3D Tiles are.
ISOBRICK_API bool has_levels(MeshFormat format);

/// Levels of detail at most.
inline constexpr int kMaxMeshLevels = 16;

/// How a mesh file is written.
struct MeshFileOptions {
  std::optional<MeshFormat> format = {};  ///< nullopt: by the name's extension
  bool quantize = false;                  ///< GLB: 16 bits a number (KHR_mesh_quantization)
  /// GLB, beside `quantize` or alone, and 3D Tiles: compressed without loss
  /// (EXT_meshopt_compression). Throws UsageError in a build without meshoptimizer.
  bool compress = false;
  /// Of formats with levels of detail: how many at most, 1 to kMaxMeshLevels. Each has a quarter of
  /// the triangles of the one before. 0: until one part has the whole mesh.
  int levels = 0;
  bool sharded = false;  ///< neuroglancer: few large files
  bool force = false;    ///< replaces a file that exists
  /// Of the mesh, for people: of a GLB its node and mesh, of an OBJ its object, of a PLY a comment.
  std::string name = {};
  /// Of the whole mesh, sRGB: of a GLB its material's, of an OBJ and a PLY all vertices'.
  std::optional<VertexColour> colour = {};
  int threads = 0;  ///< that may help to write; 0: all cores
  /// Bytes of the whole operation's budget, of which the sink takes a small part
  /// (MeshSink::memory).
  std::uint64_t memory = std::uint64_t{1} << 30;
  /// Of formats with levels of detail and compressed GLB: hears of what takes long in finish(),
  /// within the stage of the extraction. As MeshFilterOptions::progress.
  Progress* progress = nullptr;
};

/// Opens a mesh file for extract(). It has its name once it is finished; a sink that is destroyed
/// before leaves nothing. The name "-" is standard output, which is written to once the mesh is
/// finished, of OBJ sooner; PVTP and folders cannot go there. Throws UsageError when the file
/// exists and `force` is not set, its name has no known extension, options do not fit the format or
/// the format needs a library that is not there; Error when it cannot be made.
ISOBRICK_API std::unique_ptr<MeshSink> create_mesh_file(const std::filesystem::path& path,
                                                        const MeshFileOptions& options);

/// What MeshSink::memory() of such a mesh is. MeshFileOptions::format is not looked at.
ISOBRICK_API std::uint64_t mesh_file_memory(MeshFormat format, const MeshFileOptions& options);

}  // namespace isobrick
