#include "tools/mesh_space.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include <isobrick/error.h>

namespace isobrick::tools {

namespace fs = std::filesystem;

MeshBytes predict_bytes(const MeshForm& form, MeshSize size) {
  constexpr std::uint64_t header = 2048, declaration = 192, triangle = 12, vector = 12,
                          quantized_vector = 8;
  const std::uint64_t vectors = form.normals ? 2 : 1, v = size.vertices, t = size.triangles;
  const std::uint64_t attributes = v * form.attributes * sizeof(float);
  const std::uint64_t rows = v * vectors * vector + attributes;
  // A triangle in scratch files.
  const std::uint64_t numbers = v > kMaxNarrowVertices ? sizeof(WideTriangle) : triangle;
  // What waits in scratch files is on the disk twice for a moment.
  switch (form.format) {
    case MeshFormat::stl: return {header + t * 50, header + t * 50};
    case MeshFormat::ply: {
      const std::uint64_t file = header + rows + (form.colours ? 3 * v : 0) + t * 13;
      return {file, file + t * 13};
    }
    case MeshFormat::obj: {
      // As long as such lines are mostly; decimals end where they are exact.
      constexpr std::uint64_t vertex_line = 22, normal_line = 34;
      const std::uint64_t digits = fmt::formatted_size("{}", v / 2);
      const std::uint64_t vertices = v * (vertex_line + (form.normals ? normal_line : 0));
      const std::uint64_t faces =
          t * (form.normals ? 2 + 3 * (2 * digits + 3) : 2 + 3 * (digits + 1));
      return {header + vertices + faces, header + vertices + 2 * faces};
    }
    case MeshFormat::glb: {
      const std::uint64_t colours = form.colours ? 8 * v : 0, waiting = rows + colours / 2;
      if (form.compress) {
        // As much as noisy surfaces take; smooth ones take less.
        const std::uint64_t position = form.quantize ? 4 : 6, normal = form.quantize ? 6 : 10;
        const std::uint64_t file =
            header + v * (position + (vectors - 1) * normal) + attributes + colours + 2 * t;
        return {file, file + std::max(waiting + t * triangle, file)};
      }
      const std::uint64_t stored =
          form.quantize ? v * vectors * quantized_vector + attributes : rows;
      const std::uint64_t file = header + stored + colours + t * triangle;
      return {file, file + waiting + t * triangle};
    }
    case MeshFormat::vtp: {
      const std::uint64_t file = header + form.attributes * declaration + rows + t * (triangle + 4);
      return {file, file + (vectors - 1) * v * vector + attributes + t * triangle};
    }
    case MeshFormat::pvtp: {
      // A few vertices in a hundred belong to several parts.
      const std::uint64_t points = rows + v * sizeof(std::int64_t);  // with global ids
      const std::uint64_t file = header + points + points / 20 + t * (triangle + 4);
      return {file, file + rows + t * triangle};
    }
    case MeshFormat::neuroglancer: {
      // A triangle takes about 2.5 bytes, and all coarser levels a third of level 0. Scratch files
      // hold the mesh, its simplification and sorted triangles.
      const std::uint64_t file = header + t * 10 / 3, mesh = v * vector + t * numbers;
      return {file, 2 * file + 2 * mesh + 2 * t * numbers + v * 24};
    }
    case MeshFormat::tiles3d: {
      // Cuts at tiles add about a tenth, coarser levels a third, and a tile's JSON two bytes a
      // triangle. Scratch files as above; compressed as GLB is.
      const std::uint64_t mesh = rows + t * triangle;
      const std::uint64_t stored = form.compress ? v * (6 + (vectors - 1) * 10) + 2 * t : mesh;
      const std::uint64_t file = header + (stored * 11 / 10 + 2 * t) * 4 / 3;
      return {file, file + 2 * (rows + t * numbers) + 2 * t * numbers + v * 24};
    }
  }
  return {};
}

std::uint64_t predict_label_bytes(const MeshForm& form, const MeshFilterOptions& filter,
                                  const LabelTotals& totals, int at_a_time) {
  const auto scratch_of = [&](MeshSize size) {
    const MeshBytes bytes = predict_bytes(form, size);
    return bytes.needed - bytes.file + filter_scratch_bytes(filter, size, form.normals);
  };
  // Shards have their headers once; each label has a manifest in them and a line in the list.
  const std::uint64_t header = predict_bytes(form, {}).file,
                      each = form.sharded ? std::uint64_t{512} : header;
  const std::uint64_t files = predict_bytes(form, totals.size).file +
                              each * (totals.labels - std::min<std::uint64_t>(totals.labels, 1));
  // No more at a time than all of them, and none larger than the largest.
  return files + std::min(static_cast<std::uint64_t>(at_a_time) * scratch_of(totals.largest),
                          scratch_of(totals.size));
}

std::uint64_t free_space(const fs::path& path) {
  const fs::path folder = path.parent_path().empty() ? fs::path(".") : path.parent_path();
  std::error_code failure;
  if (!fs::is_directory(folder, failure))
    throw Error(
        fmt::format("cannot create '{}': there is no folder '{}'", path.string(), folder.string()));
  const fs::space_info space = fs::space(folder, failure);
  if (failure) throw system_error("read the free space of", folder.string(), failure.value());
  return space.available;
}

std::optional<Shortage> find_shortage(
    std::span<const PlannedMesh> meshes,
    const std::function<std::uint64_t(const fs::path&)>& free_space) {
  const auto enlarged = [](std::uint64_t count, double by) {
    return static_cast<std::uint64_t>(std::ceil(static_cast<double>(count) * (1 + by)));
  };
  std::uint64_t finished = 0;
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    const PlannedMesh& mesh = meshes[i];
    const MeshSize size{enlarged(mesh.size.vertices, mesh.uncertainty),
                        enlarged(mesh.size.triangles, mesh.uncertainty)};
    const MeshBytes bytes = predict_bytes(mesh.form, size);
    const std::uint64_t needed =
        finished + bytes.needed + filter_scratch_bytes(mesh.filter, size, mesh.form.normals);
    const std::uint64_t free = free_space(mesh.path);
    if (needed > free) return Shortage{i, needed, free};
    finished += bytes.file;
  }
  return std::nullopt;
}

bool needs_pieces(const PlannedMesh& mesh, std::uint64_t max_narrow) {
  return (takes_wide(mesh.form.format) || mesh.filter.makes_smaller()) &&
         static_cast<double>(mesh.size.vertices) * (1 + mesh.uncertainty) >
             static_cast<double>(max_narrow);
}

}  // namespace isobrick::tools
