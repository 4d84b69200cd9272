#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include <isobrick/labels.h>
#include <isobrick/progress.h>
#include "tools/filter_options.h"
#include "tools/mesh_output.h"

// The folder of the meshes of labels.

namespace isobrick::tools {

/// How meshes of labels are written.
struct LabelOutput {
  std::string folder;
  std::optional<MeshFormat> format;  ///< nothing: by the folder's name, else PLY
  bool quantize = false, compress = false;
  int levels = 0;  ///< of detail, of formats that have them; 0: by the mesh
  bool sharded = false;
  bool normals = true;      ///< of formats with levels
  FilterArguments filters;  ///< of each mesh, without smoothing, which is that of all of them
  std::uint64_t memory = 0;
  int threads = 0;
  bool force = false, no_space_check = false;

  MeshFormat mesh_format() const;
};

/// Throws UsageError for a form of meshes that makes no sense for labels, and for standard output.
void check_label_output(const LabelOutput& output);
/// Throws UsageError for a folder that is named as a file of another format.
void check_label_folder(const LabelOutput& output);

/// What the list of the meshes has of the image.
struct LabelListing {
  std::string name;
  int level = 0;
  std::optional<LabelTable> labels;
};

/// What was written.
struct WrittenLabels {
  LabelReport report;
  MeshSize size;            ///< of all meshes in their files
  std::uint64_t bytes = 0;  ///< of the folder
};

/// Where meshes of labels go.
struct LabelTarget {
  int visits = 1;                        ///< meshes at a time
  std::filesystem::path scratch_beside;  ///< the folder
  std::function<void(const LabelTotals&)> check_totals;
  LabelVisitor visit;
};

/// Makes the meshes and passes them on.
using MakeLabels = std::function<LabelReport(const LabelTarget& target)>;

/// Writes the folder, which has its name when all of it is there. Throws as FolderOutput does,
/// before anything is made, UsageError for a budget too small, and Error before the first mesh
/// where all of them do not fit the disk.
WrittenLabels write_labels(const LabelOutput& output, const LabelListing& listing,
                           const MakeLabels& make);

/// Makes meshes from pieces, for write_labels(). Throws Error where the disk has no room for the
/// meshes and their scratch file, before anything is read.
LabelReport merge_labels(const LabelOutput& output, std::span<const std::filesystem::path> pieces,
                         const LabelTarget& target, Progress& progress);

/// "12 labels: 3.1 M triangles".
std::string sizes_text(const WrittenLabels& written);

}  // namespace isobrick::tools
