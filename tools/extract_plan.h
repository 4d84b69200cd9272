#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <isobrick/labels.h>
#include <isobrick/part.h>
#include <isobrick/store_reader.h>
#include "tools/attribute_option.h"
#include "tools/extract_report.h"
#include "tools/filter_options.h"
#include "tools/input.h"
#include "tools/pictures.h"

// What `isobrick extract` was asked for, and what it will make of it.

namespace isobrick::tools {

struct ExtractArguments {
  InputArguments input;
  std::vector<IsovalueRequest> isovalues;
  std::optional<std::vector<LabelRange>> labels;  ///< in place of isovalues; none: all of them
  std::string output;        ///< empty: by the input's name, unless nothing is to be written
  std::optional<Part> part;  ///< of the mesh, which becomes a piece; nothing: all of it
  PreviewRequest preview;
  std::optional<MeshFormat> format;         ///< of the output; nothing: by its name
  bool quantize = false, compress = false;  ///< of GLB
  int levels = 0;        ///< of detail, of formats that have them; 0: by the mesh
  bool sharded = false;  ///< neuroglancer
  bool level_given = false;
  std::optional<int> level = 0;                ///< nothing: the finest that is small enough
  std::optional<std::uint64_t> max_triangles;  ///< of all surfaces; chooses the level
  RegionArguments region;
  std::optional<Inside> inside;
  std::optional<bool> normals;  ///< nothing: where the format holds them
  FilterArguments filters;
  std::vector<AttributeRequest> attributes;
  ColourRequest colours;
  std::uint64_t attribute_memory = 0;  ///< that sampling them takes, of each surface
  bool drop_degenerate = false;
  Topology topology = Topology::consistent;
  bool cap = false;
  bool for_print = false;  ///< --preset print
  std::uint64_t memory = std::uint64_t{1} << 30;
  int threads = 0;
  IndexChoice search;
  Backend backend = Backend::automatic;
  std::uint64_t gpu_memory = 0;
  std::vector<int> devices;  ///< that share the work; none: the first, of ranks one each
  bool estimate = false, force = false, no_space_check = false, resume = false;
  bool mpi = true;  ///< the ranks of a job share the work

  /// Whether meshes are written.
  bool writes_mesh() const { return !output.empty() || (preview.path.empty() && !estimate); }
  /// Meshes and pictures of one surface.
  std::size_t outputs() const { return std::size_t{writes_mesh()} + !preview.path.empty(); }
};

/// What a preset adds to arguments that are not given; the unit: choose_mesh_unit().
ExtractArguments with_preset(ExtractArguments arguments);

/// Millimetres for a print, unless another unit was requested; a note where the volume's unit is
/// not known. Throws UsageError where a unit was requested that cannot be had.
void choose_mesh_unit(ExtractArguments& arguments, const StoreReader& store, Console& console);

/// Throws UsageError for arguments that contradict each other, before anything is opened.
void check_arguments(const ExtractArguments& arguments);

/// Refuses outputs whose names are known and that exist or have no folder, before anything is
/// converted.
void check_outputs(const ExtractArguments& arguments);

/// Resolves the isovalues, chooses the level and names the outputs. Throws UsageError for an
/// isovalue that is missing (with a suggestion) or given twice, and for outputs of one name.
std::vector<ExtractedSurface> plan_surfaces(const ExtractArguments& arguments,
                                            const StoreReader& store, Console& console);

/// Of the budget, what the mesh of a surface may use to hold what it writes later.
std::uint64_t memory_of_mesh(const ExtractedSurface& surface, std::size_t surfaces);

ExtractEstimate estimate_one(const ExtractedSurface& surface, const StoreReader& store);

/// Refuses meshes that cannot fit their disk, or equal parts of them, before anything is written.
void check_space(const std::vector<ExtractedSurface>& surfaces, const StoreReader& store,
                 std::uint64_t parts = 1);

/// Whether a mesh may have more vertices than an extraction numbers at once, and its format holds
/// more: then it is to be made by way of pieces.
bool need_pieces(const std::vector<ExtractedSurface>& surfaces, const StoreReader& store);

/// Refuses a budget in which pictures cannot be drawn, before anything is extracted.
void check_pictures(const std::vector<ExtractedSurface>& surfaces,
                    const ExtractArguments& arguments, const StoreReader& store);

}  // namespace isobrick::tools
