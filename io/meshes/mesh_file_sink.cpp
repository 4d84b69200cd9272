#include <isobrick/mesh_file_sink.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>

#include <isobrick/error.h>
#include "io/meshes/glb_sink.h"
#include "io/meshes/levels/level_folder.h"
#include "io/meshes/obj_sink.h"
#include "io/meshes/ply_sink.h"
#include "io/meshes/stl_sink.h"
#include "io/meshes/vtp_sink.h"

namespace isobrick::inline v0 {
namespace {

struct NamedFormat {
  MeshFormat format;
  std::string_view extension, name;
};

constexpr std::array<NamedFormat, 8> kFormats{
    {{MeshFormat::ply, ".ply", "PLY"},
     {MeshFormat::stl, ".stl", "STL"},
     {MeshFormat::obj, ".obj", "OBJ"},
     {MeshFormat::glb, ".glb", "GLB"},
     {MeshFormat::vtp, ".vtp", "VTP"},
     {MeshFormat::pvtp, ".pvtp", "PVTP"},
     {MeshFormat::neuroglancer, ".neuroglancer", "neuroglancer's format"},
     {MeshFormat::tiles3d, ".3dtiles", "3D Tiles"}}};

/// What the arrays of a file that come behind the vertices may take of a budget until they are
/// written, rather than to be written and read once more: nothing of a small one, which the
/// extraction needs.
std::size_t waiting_memory(std::uint64_t memory) {
  constexpr std::uint64_t mib = std::uint64_t{1} << 20;
  return memory < 512 * mib ? 0 : static_cast<std::size_t>(std::min(memory / 8, 1024 * mib));
}

MeshLabelling labelling_of(const MeshFileOptions& options) {
  return {options.name, options.colour};
}

GlbOptions glb_options(const MeshFileOptions& options) {
  return {.quantize = options.quantize,
          .labelling = labelling_of(options),
          .compress = options.compress,
          .progress = options.progress};
}

/// Throws UsageError for levels that the format has not.
void check_levels(MeshFormat format, const MeshFileOptions& options) {
  if (!has_levels(format) && options.levels != 0)
    throw UsageError(fmt::format(
        "{} has no levels of detail; neuroglancer's format and 3D Tiles have", name_of(format)));
  if (format != MeshFormat::neuroglancer && options.sharded)
    throw UsageError(fmt::format("{} has no shards; neuroglancer's format has", name_of(format)));
  if (options.levels < 0 || options.levels > kMaxMeshLevels)
    throw UsageError(
        fmt::format("a mesh has 1 to {} levels of detail, not {}", kMaxMeshLevels, options.levels));
}

}  // namespace

std::string_view name_of(MeshFormat format) {
  return kFormats[static_cast<std::size_t>(format)].name;
}

std::string_view extension_of(MeshFormat format) {
  return kFormats[static_cast<std::size_t>(format)].extension;
}

std::optional<MeshFormat> find_mesh_format(std::string_view extension) {
  const auto same = [](char a, char b) {
    return a == (b >= 'A' && b <= 'Z' ? b + ('a' - 'A') : b);
  };
  for (const NamedFormat& known : kFormats)
    if (std::ranges::equal(known.extension, extension, same)) return known.format;
  return std::nullopt;
}

bool has_normals(MeshFormat format) {
  return format != MeshFormat::stl && format != MeshFormat::neuroglancer;
}

bool has_vertices(MeshFormat format) { return format != MeshFormat::stl; }

bool takes_wide(MeshFormat format) {
  return format == MeshFormat::obj || format == MeshFormat::glb || format == MeshFormat::vtp ||
         format == MeshFormat::pvtp || has_levels(format);
}

bool has_attributes(MeshFormat format) {
  return format != MeshFormat::stl && format != MeshFormat::obj && !has_levels(format);
}

bool has_levels(MeshFormat format) {
  return format == MeshFormat::neuroglancer || format == MeshFormat::tiles3d;
}

std::unique_ptr<MeshSink> create_mesh_file(const std::filesystem::path& path,
                                           const MeshFileOptions& options) {
  const std::string name = path.string();
  const bool force = options.force;
  const auto format = options.format ? options.format : find_mesh_format(path.extension().string());
  if (!format)
    throw UsageError(fmt::format(
        "'{}' is no mesh that can be written; name it .ply, .stl, .obj, .glb, .vtp, .pvtp, "
        ".neuroglancer or .3dtiles",
        name));
  check_levels(*format, options);
  switch (*format) {
    case MeshFormat::ply:
      return std::make_unique<PlySink>(name, force, waiting_memory(options.memory),
                                       labelling_of(options));
    case MeshFormat::stl: return std::make_unique<StlSink>(name, force);
    case MeshFormat::obj:
      return std::make_unique<ObjSink>(name, force, options.threads, labelling_of(options));
    case MeshFormat::glb: return std::make_unique<GlbSink>(name, force, glb_options(options));
    case MeshFormat::vtp:
      return std::make_unique<VtpSink>(name, force, waiting_memory(options.memory));
    case MeshFormat::pvtp:
      return std::make_unique<PvtpSink>(name, force, PvtpSink::kPartTriangles,
                                        PvtpSink::threads_within(options.threads, options.memory));
    case MeshFormat::neuroglancer:
    case MeshFormat::tiles3d:
      return create_level_mesh(path, force,
                               {.as_tiles = *format == MeshFormat::tiles3d,
                                .compress = options.compress,
                                .sharded = options.sharded},
                               {.levels = options.levels,
                                .threads = options.threads,
                                .memory = level_share(options.memory),
                                .progress = options.progress});
  }
  throw UsageError("no such format of a mesh");
}

std::uint64_t mesh_file_memory(MeshFormat format, const MeshFileOptions& options) {
  switch (format) {
    case MeshFormat::ply:
    case MeshFormat::vtp: return waiting_memory(options.memory);
    case MeshFormat::obj: return ObjSink::memory_with(options.threads);
    case MeshFormat::glb: return GlbSink::memory_with(glb_options(options));
    case MeshFormat::pvtp:
      return PvtpSink::memory_with(PvtpSink::threads_within(options.threads, options.memory));
    case MeshFormat::neuroglancer:
    case MeshFormat::tiles3d:
      return level_memory({.threads = options.threads, .memory = level_share(options.memory)});
    default: return 0;
  }
}

}  // namespace isobrick
