#include "tools/mesh_output.h"

#include <fmt/format.h>

#include <isobrick/error.h>
#include "io/bytes/folder_walk.h"
#include "io/bytes/parted_output.h"
#include "io/meshes/mesh_parts.h"
#include "tools/format.h"
#include "tools/output_name.h"
#include "tools/parse.h"

namespace isobrick::tools {

namespace fs = std::filesystem;

namespace {

/// Throws UsageError where the name has the extension of another format, or is standard output and
/// the format has several files.
void check_mesh_name(const fs::path& path, MeshFormat format) {
  const std::string_view extension = isobrick::extension_of(format);
  if (is_standard_output(path.native())) {
    if (has_levels(format))
      throw UsageError(fmt::format("{} is a folder, which standard output cannot take: name it",
                                   name_of(format)));
    if (format != MeshFormat::pvtp) return;
    throw UsageError(
        "PVTP has several files, which standard output cannot take: name a file, or add --format "
        "vtp");
  }
  const std::string_view extensions[] = {extension};
  refuse_misleading_name(path.string(), extensions,
                         fmt::format("--format {} writes another format", extension.substr(1)));
}

/// Throws UsageError for attributes that the format cannot hold.
void check_attribute_format(const MeshForm& form) {
  if (form.attributes > 0 && !has_attributes(form.format))
    throw UsageError(
        fmt::format("--attribute: {} cannot hold attributes of vertices; choose PLY, VTP, PVTP or "
                    "GLB",
                    name_of(form.format)));
  if (form.colours && form.format != MeshFormat::ply && form.format != MeshFormat::glb)
    throw UsageError(fmt::format(
        "--colour-by is for GLB and PLY, and this mesh becomes {}, whose readers colour "
        "by the attribute itself",
        name_of(form.format)));
}

}  // namespace

MeshFormat mesh_format(const fs::path& path) {
  if (is_standard_output(path.native())) return MeshFormat::ply;
  if (const auto format = find_mesh_format(without_slash(path).extension().string()))
    return *format;
  throw UsageError(
      fmt::format("'{}' is no mesh that can be written; name it .ply, .stl, .obj, .glb, .vtp, "
                  ".pvtp, .neuroglancer or .3dtiles, or add --format",
                  path.string()));
}

MeshFormat parse_mesh_format(const std::string& text) {
  if (const auto format = find_mesh_format("." + text)) return *format;
  throw UsageError(fmt::format(
      "'{}' is no format of a mesh; it is ply, stl, obj, glb, vtp, pvtp, neuroglancer or 3dtiles",
      text));
}

std::uint64_t memory_of_file(const MeshForm& form, int threads, std::uint64_t memory) {
  return mesh_file_memory(form.format,
                          {.compress = form.compress, .threads = threads, .memory = memory});
}

void check_compression(const MeshForm& form) {
  if (form.compress && form.format != MeshFormat::glb && form.format != MeshFormat::tiles3d)
    throw UsageError(fmt::format(
        "--compress is for GLB and 3D Tiles only, and this mesh becomes {}: add --format glb or "
        "3dtiles",
        name_of(form.format)));
}

void check_levels(const MeshForm& form) {
  if (form.levels > 0 && !has_levels(form.format))
    throw UsageError(fmt::format(
        "--levels is for neuroglancer and 3D Tiles only, and this mesh becomes {}: add --format "
        "neuroglancer or 3dtiles",
        name_of(form.format)));
  if (form.sharded && form.format != MeshFormat::neuroglancer)
    throw UsageError(fmt::format(
        "--sharded is for neuroglancer only, and this mesh becomes {}: add --format neuroglancer",
        name_of(form.format)));
}

MeshForm with_format(MeshForm form, const std::optional<MeshFormat>& named,
                     const fs::path& output) {
  if (named)
    form.format = *named;
  else if (!output.empty())
    form.format = mesh_format(output);
  if (!output.empty()) check_mesh_name(output, form.format);
  if (form.quantize && form.format != MeshFormat::glb)
    throw UsageError(
        fmt::format("--quantize is for GLB only, and this mesh becomes {}", name_of(form.format)));
  check_compression(form);
  check_levels(form);
  check_attribute_format(form);
  return form;
}

void check_can_write_mesh(const fs::path& path, MeshFormat format, bool force) {
  const fs::path name = without_slash(path);
  std::error_code none;
  if (!has_levels(format) || !fs::is_directory(name, none))
    check_can_write(name, force);
  else if (!force)
    throw UsageError(fmt::format("'{}' exists already; add --force to replace it", path.string()));
}

int parse_detail_levels(const std::string& text) {
  return text == "auto" ? 0 : parse_int(text, 1, kMaxMeshLevels);
}

std::uint64_t mesh_bytes(const fs::path& path) {
  std::uint64_t bytes = 0;
  if (fs::is_directory(path)) {
    walk_folder(path, [&](const fs::path& name, fs::file_type type) {
      if (type == fs::file_type::regular) bytes += fs::file_size(path / name);
      return true;
    });
    return bytes;
  }
  bytes = fs::file_size(path);
  for (const fs::path& folder : part_folders(path))
    for (const FolderEntry& part : folder_entries(folder))
      bytes += fs::file_size(folder / part.name);
  return bytes;
}

fs::path with_isovalue(const fs::path& path, double isovalue) {
  const fs::path plain = without_slash(path);
  fs::path name = plain.stem();
  name += fmt::format("_{}", isovalue);
  name += plain.extension();
  return plain.parent_path() / name;
}

}  // namespace isobrick::tools
