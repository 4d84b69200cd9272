#pragma once

#include <memory>
#include <string>

#include "io/bytes/mapped_file.h"
#include "io/meshes/readers/mesh_file.h"

namespace isobrick::inline v0 {

// One a format; `path` is for messages. Each throws Error for a file that is damaged
// or has what is not read.
std::unique_ptr<MeshFile> read_ply(const std::string& path, std::shared_ptr<MappedFile> file);
std::unique_ptr<MeshFile> read_stl(const std::string& path, std::shared_ptr<MappedFile> file);
/// STL in text.
std::unique_ptr<MeshFile> read_text_stl(const std::string& path, std::shared_ptr<MappedFile> file);
std::unique_ptr<MeshFile> read_glb(const std::string& path, std::shared_ptr<MappedFile> file);
/// A glTF scene that is no GLB.
std::unique_ptr<MeshFile> read_gltf(const std::string& path, std::shared_ptr<MappedFile> file);
std::unique_ptr<MeshFile> read_obj(const std::string& path, std::shared_ptr<MappedFile> file);
/// VTK PolyData, or its index of parts. Throws UsageError where expat was missing.
std::unique_ptr<MeshFile> read_vtp(const std::string& path, std::shared_ptr<MappedFile> file);

}  // namespace isobrick
