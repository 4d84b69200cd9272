#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>

#include <isobrick/labels.h>
#include <isobrick/mesh.h>
#include <isobrick/mesh_filters.h>
#include "tools/mesh_output.h"

namespace isobrick::tools {

/// What a mesh takes on disk.
struct MeshBytes {
  std::uint64_t file = 0;    ///< the finished file
  std::uint64_t needed = 0;  ///< at the worst moment, scratch files included
};
MeshBytes predict_bytes(const MeshForm& form, MeshSize size);

/// Bytes that a folder of meshes of labels takes at the worst moment, scratch files included, where
/// so many meshes are written at a time.
std::uint64_t predict_label_bytes(const MeshForm& form, const MeshFilterOptions& filter,
                                  const LabelTotals& totals, int at_a_time);

/// Bytes free on the disk that `path` will be written to.
std::uint64_t free_space(const std::filesystem::path& path);

/// A mesh that is to be written.
struct PlannedMesh {
  std::filesystem::path path;
  MeshForm form;
  MeshSize size;
  double uncertainty = 0;         ///< by what fraction it may be larger
  MeshFilterOptions filter = {};  ///< whose scratch files lie on the same disk
};

/// The first mesh that does not fit its disk.
struct Shortage {
  std::size_t mesh = 0;
  std::uint64_t needed = 0, free = 0;  ///< bytes; `needed` with the meshes before it
};

/// Whether the meshes, made one after the other, fit `free_space`.
std::optional<Shortage> find_shortage(
    std::span<const PlannedMesh> meshes,
    const std::function<std::uint64_t(const std::filesystem::path&)>& free_space);

/// Whether a mesh may have more vertices than `max_narrow`, which an extraction can number at once,
/// and can be written all the same: by way of pieces, in a format without a limit or where a filter
/// makes it smaller.
bool needs_pieces(const PlannedMesh& mesh, std::uint64_t max_narrow);

}  // namespace isobrick::tools
