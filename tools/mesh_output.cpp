#include "tools/mesh_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "isobrick/core/error.h"
#include "isobrick/io/folder_walk.h"
#include "isobrick/io/parted_output.h"
#include "isobrick/meshes/glb_sink.h"
#include "isobrick/meshes/mesh_parts.h"
#include "isobrick/meshes/obj_sink.h"
#include "isobrick/meshes/ply_sink.h"
#include "isobrick/meshes/stl_sink.h"
#include "isobrick/meshes/vtp_sink.h"
#include "tools/format.h"
#include "tools/output_name.h"

namespace isobrick::tools {
namespace {

namespace fs = std::filesystem;

struct NamedFormat {
  MeshFormat format;
  std::string_view word, name;
};

constexpr std::array<NamedFormat, 6> kFormats{{{MeshFormat::ply, "ply", "PLY"},
                                               {MeshFormat::stl, "stl", "STL"},
                                               {MeshFormat::obj, "obj", "OBJ"},
                                               {MeshFormat::glb, "glb", "GLB"},
                                               {MeshFormat::vtp, "vtp", "VTP"},
                                               {MeshFormat::pvtp, "pvtp", "PVTP"}}};

/// What a PLY file's faces may take of a budget until they are written: nothing of a small one,
/// which the extraction needs.
std::size_t faces_memory(std::uint64_t memory) {
  constexpr std::uint64_t mib = std::uint64_t{1} << 20;
  return memory < 512 * mib ? 0 : static_cast<std::size_t>(std::min(memory / 16, 64 * mib));
}

}  // namespace

std::string_view name_of(MeshFormat format) {
  return kFormats[static_cast<std::size_t>(format)].name;
}

bool has_normals(MeshFormat format) { return format != MeshFormat::stl; }

bool has_vertices(MeshFormat format) { return format != MeshFormat::stl; }

MeshFormat mesh_format(const fs::path& path) {
  if (is_standard_output(path.native()))
    throw UsageError("standard output has no name that says a format: say --format obj");
  const std::string extension = extension_of(path);
  for (const NamedFormat& known : kFormats)
    if (extension == fmt::format(".{}", known.word)) return known.format;
  throw UsageError(
      fmt::format("'{}' is no mesh that can be written; name it .ply, .stl, .obj, .glb, .vtp or "
                  ".pvtp, or say --format",
                  path.string()));
}

void check_mesh_name(const fs::path& path, MeshFormat format) {
  const std::string_view word = kFormats[static_cast<std::size_t>(format)].word;
  if (is_standard_output(path.native())) {
    if (format == MeshFormat::obj) return;
    throw UsageError(
        fmt::format("{} cannot go to standard output, because its beginning is written last: "
                    "name a file, or say --format obj",
                    name_of(format)));
  }
  const std::string own = fmt::format(".{}", word);
  const std::string_view extensions[] = {own};
  refuse_misleading_name(path.string(), extensions,
                         fmt::format("--format {} writes another format", word));
}

MeshFormat parse_mesh_format(const std::string& text) {
  for (const NamedFormat& known : kFormats)
    if (text == known.word) return known.format;
  throw UsageError(
      fmt::format("'{}' is no format of a mesh; it is ply, stl, obj, glb, vtp or pvtp", text));
}

std::unique_ptr<MeshSink> open_mesh(const fs::path& path, const MeshForm& form, bool force,
                                    int threads, std::uint64_t memory) {
  const std::string name = path.string();
  switch (form.format) {
    case MeshFormat::ply: return std::make_unique<PlySink>(name, force, faces_memory(memory));
    case MeshFormat::stl: return std::make_unique<StlSink>(name, force);
    case MeshFormat::obj: return std::make_unique<ObjSink>(name, force, threads);
    case MeshFormat::glb:
      return std::make_unique<GlbSink>(name, force, GlbOptions{.quantize = form.quantize});
    case MeshFormat::vtp: return std::make_unique<VtpSink>(name, force);
    case MeshFormat::pvtp: return std::make_unique<PvtpSink>(name, force);
  }
  throw UsageError("no such format of a mesh");
}

std::uint64_t mesh_memory(MeshFormat format, int threads, std::uint64_t memory) {
  switch (format) {
    case MeshFormat::ply: return faces_memory(memory);
    case MeshFormat::obj: return ObjSink::memory_with(threads);
    case MeshFormat::glb: return part_memory(GlbOptions{}.part_triangles);
    case MeshFormat::pvtp: return part_memory(PvtpSink::kPartTriangles);
    default: return 0;
  }
}

std::uint64_t mesh_bytes(const fs::path& path) {
  std::uint64_t bytes = fs::file_size(path);
  for (const fs::path& folder : part_folders(path))
    for (const FolderEntry& part : folder_entries(folder))
      bytes += fs::file_size(folder / part.name);
  return bytes;
}

fs::path with_isovalue(const fs::path& path, double isovalue) {
  fs::path name = path.stem();
  name += fmt::format("_{}", isovalue);
  name += path.extension();
  return path.parent_path() / name;
}

}  // namespace isobrick::tools
