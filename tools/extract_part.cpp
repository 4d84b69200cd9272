#include "tools/extract_part.h"

#include <filesystem>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <isobrick/error.h>
#include <isobrick/pieces.h>
#include "bricks/zarr/metadata_files.h"
#include "io/bytes/output_guard.h"
#include "tools/format.h"
#include "tools/interrupt.h"
#include "tools/output_name.h"

namespace isobrick::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

/// The piece of a surface: "head_500_3of8.piece" where no name is given.
fs::path piece_name(const ExtractArguments& arguments, double isovalue) {
  if (!arguments.output.empty())
    return arguments.isovalues.size() == 1 ? fs::path(arguments.output)
                                           : with_isovalue(arguments.output, isovalue);
  const fs::path mesh = with_isovalue(
      stem_of_input(arguments.input.path, arguments.input.volume) + std::string(kPieceExtension),
      isovalue);
  return fmt::format("{}_{}of{}{}", mesh.stem().string(), arguments.part->number,
                     arguments.part->count, kPieceExtension);
}

/// The surfaces as if all of their meshes were to be written, with the names of the pieces.
std::vector<ExtractedSurface> plan_pieces(ExtractArguments arguments, const StoreReader& store,
                                          Console& console) {
  const ExtractArguments given = arguments;
  arguments.output.clear();
  arguments.format = MeshFormat::ply;  // normals and space on the disk are about those of a PLY
  check_arguments(arguments);
  std::vector<ExtractedSurface> surfaces = plan_surfaces(arguments, store, console);
  for (ExtractedSurface& surface : surfaces)
    surface.output = piece_name(given, surface.options.isovalue);
  return surfaces;
}

ordered_json piece_json(const ExtractedSurface& surface, const PieceReport& report) {
  ordered_json object = report_json(surface, report.surface, {}, report.bytes);
  object["kept"] = report.is_kept;
  return object;
}

std::string piece_text(const ExtractedSurface& surface, const PieceReport& report,
                       const Part& part) {
  if (!report.is_kept)
    return fmt::format("part {} of {}, {}", part.number, part.count,
                       report_text(surface, report.surface, {}, report.bytes, true));
  return fmt::format("part {} of {}, isovalue {}: is there already, {} triangles\n  {} ({})\n",
                     part.number, part.count, surface.options.isovalue,
                     human_count(report.surface.triangles), surface.output.string(),
                     human_bytes(report.bytes));
}

}  // namespace

void check_part_arguments(const ExtractArguments& arguments) {
  FilterArguments filters = arguments.filters;
  if (arguments.labels) filters.smooth = 0;  // all meshes are smoothed together, in their pieces
  const std::pair<bool, const char*> of_merge[] = {
      {filter_options(filters).any(), "a filter, --measure or --mesh-unit"},
      {!arguments.attributes.empty(), "--attribute"},
      {!arguments.colours.attribute.empty(), "--colour-by"},
      {arguments.format.has_value(), "--format"},
      {arguments.quantize, "--quantize"},
      {arguments.compress, "--compress"},
      {arguments.levels > 0, "--levels"},
      {arguments.sharded, "--sharded"},
      {arguments.labels && arguments.normals, "--normals"},
      {arguments.for_print, "--preset"}};
  for (const auto& [is_given, name] : of_merge)
    if (is_given)
      throw UsageError(
          fmt::format("--part: {} is for the whole mesh: give it to 'isobrick merge'", name));
  const std::pair<bool, const char*> others[] = {{!arguments.preview.path.empty(), "--preview"},
                                                 {arguments.estimate, "--estimate"},
                                                 {arguments.devices.size() > 1, "a second device"}};
  for (const auto& [is_given, name] : others)
    if (is_given) throw UsageError(fmt::format("--part: {} is not for parts: leave it out", name));
  refuse_url_output(arguments.output);
  if (is_standard_output(arguments.output))
    throw UsageError("--part: a piece is a file, which is found again: name it with -o");
  refuse_misleading_name(
      arguments.output, std::span(&kPieceExtension, 1),
      "--part makes a piece: name it .piece, and 'isobrick merge' makes the mesh");
  // A conversion of each task would cost more than the surface.
  if (!is_zarr(arguments.input.path))
    throw UsageError(
        fmt::format("--part: '{}' is no store: make one for all tasks with 'isobrick convert'",
                    arguments.input.path));
}

int run_extract_part(const ExtractArguments& given, Console& console) {
  check_part_arguments(given);
  const OpenedVolume input = open_input(given.input, given.memory, given.threads, console);
  const StoreReader& store = input.store();
  const std::vector<ExtractedSurface> surfaces = plan_pieces(given, store, console);
  const std::vector<fs::path> inputs{given.input.path};
  set_interrupt_note([] { return "the same command begins the piece anew"; });
  ordered_json objects = ordered_json::array();
  std::string text;
  for (const ExtractedSurface& surface : surfaces) {
    check_replaces_no_input(surface.output, inputs);
    if (!given.no_space_check && !fs::exists(surface.output))
      check_space({surface}, store, given.part->count);
    const PieceReport report = extract_piece(store, surface.options, *given.part, surface.output,
                                             given.force, console.progress());
    objects.push_back(piece_json(surface, report));
    text += piece_text(surface, report, *given.part);
  }
  console.result({{"command", "extract"},
                  {"input", given.input.path},
                  {"level", surfaces.front().options.level},
                  {"estimate", false},
                  {"part", {{"number", given.part->number}, {"count", given.part->count}}},
                  {"surfaces", objects},
                  {"peak_resident_bytes", peak_resident_bytes()}},
                 text);
  return 0;
}

}  // namespace isobrick::tools
