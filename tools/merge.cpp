#include "tools/merge.h"

#include <algorithm>
#include <regex>

#include <fmt/format.h>

#include <isobrick/error.h>
#include <isobrick/label_pieces.h>
#include "core/stopwatch.h"
#include "io/bytes/folder_walk.h"
#include "io/bytes/leftovers.h"
#include "io/bytes/output_guard.h"
#include "io/meshes/levels/level_sink.h"
#include "tools/extract_report.h"
#include "tools/format.h"
#include "tools/label_writer.h"
#include "tools/measure_report.h"
#include "tools/mesh_space.h"
#include "tools/output_name.h"

namespace isobrick::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct MergeArguments {
  std::vector<std::string> pieces;
  std::string output;  ///< empty: by the name of the first piece
  std::optional<MeshFormat> format;
  bool quantize = false, compress = false;
  int levels = 0;
  bool sharded = false;
  FilterArguments filters;
  bool normals = true;
  std::vector<AttributeRequest> attributes;
  ColourRequest colours;
  std::uint64_t memory = 0;
  int threads = 0;
  bool force = false, no_space_check = false;
};

/// "head_500" of "head_500_3of8.piece".
std::string stem_of_piece(const std::string& piece) {
  const std::string stem = fs::path(piece).stem().string();
  return std::regex_replace(stem, std::regex("_[0-9]+of[0-9]+$"), "");
}

/// "head_500.ply" of "head_500_3of8.piece", in the current folder.
fs::path default_output(const std::string& piece, MeshFormat format) {
  return stem_of_piece(piece) + std::string(isobrick::extension_of(format));
}

MeshForm form_of(const MergeArguments& arguments) {
  return with_format({.quantize = arguments.quantize,
                      .compress = arguments.compress,
                      .levels = arguments.levels,
                      .sharded = arguments.sharded,
                      .attributes = arguments.attributes.size(),
                      .colours = !arguments.colours.attribute.empty()},
                     arguments.format, arguments.output);
}

/// Refuses a mesh that cannot fit its disk.
void check_disk(const MergeJob& job, const PiecesInfo& info) {
  const bool streams = is_standard_output(job.output.native());
  if (job.no_space_check || (streams && job.form.format == MeshFormat::obj)) return;
  const fs::path path = streams ? temporary_folder() / "isobrick" : job.output;
  const PlannedMesh mesh{.path = path, .form = job.form, .size = info.size, .filter = job.filter};
  if (const auto shortage = find_shortage({&mesh, 1}, free_space))
    throw Error(fmt::format(
        "'{}' will have {} triangles and need {}, but {} has {} free; choose another disk (or "
        "--no-space-check)",
        job.output.string(), human_count(info.size.triangles), human_bytes(shortage->needed),
        streams ? "the disk of temporary files" : "its disk", human_bytes(shortage->free)));
}

/// Filters get half of what the pieces and the file do not need.
std::uint64_t filter_memory(const MergeJob& job, const PiecesInfo& info, std::uint64_t of_output) {
  constexpr std::uint64_t least = std::uint64_t{8} << 20;
  const std::uint64_t needed = info.merge_memory + of_output + least;
  return least + (job.memory - std::min(job.memory, needed)) / 2;
}

/// The mesh with what it goes through.
struct MergeSinks {
  std::unique_ptr<MeshSink> file;
  AttributeSinks attributes;
  std::unique_ptr<MeshFilter> filter;
};

MergeSinks open_sinks(const MergeJob& job, const PiecesInfo& info,
                      const AttributeVolumes& attributes, Progress& progress) {
  MergeSinks sinks;
  sinks.file = create_mesh_file(job.output, {.format = job.form.format,
                                             .quantize = job.form.quantize,
                                             .compress = job.form.compress,
                                             .levels = job.form.levels,
                                             .sharded = job.form.sharded,
                                             .force = job.force,
                                             .threads = job.threads,
                                             .memory = job.memory,
                                             .progress = &progress});
  MeshFilterOptions filter = job.filter;
  filter.takes_welded = true;
  filter.threads = job.threads;
  filter.scratch_beside = job.output;
  filter.progress = &progress;
  MeshSink* output = sinks.file.get();
  sinks.attributes = attributes.open(*output, attributes.options(job.memory, 1));
  if (sinks.attributes.attributes) output = sinks.attributes.attributes.get();
  filter.memory = filter_memory(job, info, output->memory());
  sinks.filter = std::make_unique<MeshFilter>(*output, filter);
  return sinks;
}

ordered_json merge_json(const MergeJob& job, const MergeResult& made) {
  ordered_json object{{"command", "merge"},
                      {"pieces", job.pieces.size()},
                      {"isovalue", made.pieces.isovalue},
                      {"output", job.output.string()},
                      {"output_bytes", made.bytes},
                      {"triangles", made.size.triangles},
                      {"vertices", has_vertices(job.form.format) ? ordered_json(made.size.vertices)
                                                                 : ordered_json()},
                      {"degenerate_triangles", made.pieces.degenerate},
                      {"seconds", made.seconds}};
  const FilteredSurface& filtered = made.filtered;
  if (job.filter.changes_mesh())
    object["extracted"] = {{"triangles", filtered.extracted.triangles},
                           {"vertices", filtered.extracted.vertices}};
  if (filtered.simplify_goal) object["simplify_goal"] = *filtered.simplify_goal;
  if (filtered.measure) object["measure"] = measure_json(*filtered.measure);
  if (!filtered.levels.empty()) object["levels"] = tools::levels_json(filtered.levels);
  if (!job.attributes.empty()) object["attributes"] = names_of(job.attributes);
  object["peak_resident_bytes"] = peak_resident_bytes();
  return object;
}

std::string merge_text(const MergeJob& job, const MergeResult& made) {
  std::string text = fmt::format(
      "isovalue {}: {} triangles{} of {} {} in {}\n", made.pieces.isovalue,
      human_count(made.size.triangles),
      has_vertices(job.form.format) ? fmt::format(", {} vertices", human_count(made.size.vertices))
                                    : "",
      human_count(job.pieces.size()), job.pieces.size() == 1 ? "piece" : "pieces",
      human_seconds(made.seconds));
  if (made.filtered.extracted.triangles > made.size.triangles)
    text += fmt::format("  of {} triangles\n", human_count(made.filtered.extracted.triangles));
  if (made.filtered.measure) text += measure_text(*made.filtered.measure);
  return text + fmt::format("  {} ({})\n", job.output.string(), human_bytes(made.bytes));
}

/// Pieces of labels become a folder.
int run_merge_labels(const MergeArguments& arguments, Console& console) {
  const std::pair<bool, const char*> of_isosurfaces[] = {
      {!arguments.attributes.empty(), "--attribute"},
      {!arguments.colours.attribute.empty(), "--colour-by"}};
  for (const auto& [is_given, name] : of_isosurfaces)
    if (is_given)
      throw UsageError(
          fmt::format("{} is for isosurfaces, and these are pieces of labels: leave it out", name));
  if (arguments.filters.smooth > 0)
    throw UsageError(
        "meshes of labels are smoothed together, in their pieces: give --smooth to 'isobrick "
        "extract --part'");
  LabelOutput output{.folder = arguments.output.empty() ? stem_of_piece(arguments.pieces.front())
                                                        : arguments.output,
                     .format = arguments.format,
                     .quantize = arguments.quantize,
                     .compress = arguments.compress,
                     .levels = arguments.levels,
                     .sharded = arguments.sharded,
                     .normals = arguments.normals,
                     .filters = arguments.filters,
                     .memory = arguments.memory,
                     .threads = arguments.threads,
                     .force = arguments.force,
                     .no_space_check = arguments.no_space_check};
  check_label_output(output);
  if (!arguments.output.empty()) check_label_folder(output);
  const std::vector<fs::path> pieces(arguments.pieces.begin(), arguments.pieces.end());
  const LabelPiecesInfo info = read_label_pieces(pieces);
  check_replaces_no_input(output.folder, pieces);
  const WrittenLabels written =
      write_labels(output, {info.name, info.level, info.labels}, [&](const LabelTarget& target) {
        return merge_labels(output, pieces, target, console.progress());
      });
  const LabelReport& report = written.report;
  console.result(
      {{"command", "merge"},
       {"pieces", pieces.size()},
       {"output", output.folder},
       {"output_bytes", written.bytes},
       {"labels", report.labels},
       {"triangles", written.size.triangles},
       {"vertices", written.size.vertices},
       {"scratch_bytes", report.scratch_bytes},
       {"seconds", {{"total", report.seconds}, {"write", report.write_seconds}}},
       {"peak_resident_bytes", peak_resident_bytes()}},
      fmt::format("{} of {} {} in {}\n  {} ({})\n", sizes_text(written), human_count(pieces.size()),
                  pieces.size() == 1 ? "piece" : "pieces", human_seconds(report.seconds),
                  output.folder, human_bytes(written.bytes)));
  return 0;
}

int run_merge(const MergeArguments& arguments, Console& console) {
  if (is_label_piece(arguments.pieces.front())) return run_merge_labels(arguments, console);
  refuse_url_output(arguments.output);
  MergeJob job{.form = form_of(arguments),
               .filter = filter_options(arguments.filters),
               .attributes = arguments.attributes,
               .colours = arguments.colours,
               .memory = arguments.memory,
               .threads = arguments.threads,
               .normals = arguments.normals,
               .force = arguments.force,
               .no_space_check = arguments.no_space_check};
  check_filters(arguments.filters, false);
  check_attributes(arguments.attributes, arguments.colours);
  job.pieces.assign(arguments.pieces.begin(), arguments.pieces.end());
  job.output = !arguments.output.empty()
                   ? fs::path(has_levels(job.form.format) ? without_slash(arguments.output)
                                                          : fs::path(arguments.output))
                   : default_output(arguments.pieces.front(), job.form.format);
  if (is_standard_output(job.output.native())) console.reserve_output();
  const MergeResult made = merge(job, console);
  console.result(merge_json(job, made), merge_text(job, made));
  return 0;
}

}  // namespace

MergeResult merge(MergeJob job, Console& console) {
  MergeResult made{.pieces = read_pieces(job.pieces)};
  job.form.normals = made.pieces.header.has_normals && has_normals(job.form.format) && job.normals;
  std::vector<fs::path> inputs = paths_of(job.attributes);
  inputs.insert(inputs.end(), job.pieces.begin(), job.pieces.end());
  check_replaces_no_input(job.output, inputs);
  check_disk(job, made.pieces);
  const AttributeVolumes attributes(job.attributes, job.colours, {}, job.memory, job.threads,
                                    made.pieces.header.unit, console);
  const MergeSinks sinks = open_sinks(job, made.pieces, attributes, console.progress());
  {
    const Stopwatch watch(made.seconds);
    merge_pieces(job.pieces, *sinks.filter, {.normals = job.form.normals, .memory = job.memory},
                 console.progress());
  }
  made.size = sinks.filter->size();
  made.filtered = {made.pieces.size, sinks.filter->measure(), sinks.filter->simplify_goal()};
  if (const auto* levels = dynamic_cast<const LevelSink*>(sinks.file.get()))
    made.filtered.levels = levels->levels();
  made.bytes =
      is_standard_output(job.output.native()) ? sinks.file->bytes() : mesh_bytes(job.output);
  if (made.size.triangles == 0)
    console.note(fmt::format("isovalue {}: the surface is empty", made.pieces.isovalue));
  if (const std::string note = goal_note(made.size.triangles, made.filtered, job.filter);
      !note.empty())
    console.note(note);
  return made;
}

void add_merge(Program& program) {
  auto arguments = std::make_shared<MergeArguments>();
  CLI::App* app = add_subcommand(
      program, "merge", "Put the pieces of a mesh together, which 'extract --part' made.",
      "isobrick extract head.zarr --isovalue 900 --part 1/2   # writes head_900_1of2.piece\n"
      "  isobrick extract head.zarr --isovalue 900 --part 2/2   # on another machine\n"
      "  isobrick merge head_900_*of2.piece -o head_900.ply");
  add_paths(app, "PIECES", arguments->pieces, "All pieces of the mesh, in any order");
  add_output(app, arguments->output, "MESH",
             "Mesh to write, .ply, .stl, .obj, .glb, .vtp, .pvtp, .neuroglancer or .3dtiles; - for "
             "standard output; of labels a folder",
             "head_500.ply of head_500_1of8.piece, in the current folder");
  add_parsed(app, arguments->format,
             [](const std::string& text) { return std::optional(parse_mesh_format(text)); },
             {"--format", "ply|stl|obj|glb|vtp|pvtp|neuroglancer|3dtiles", "Format of the mesh",
              "by its extension, or ply"});
  add_flag(app, "--quantize", arguments->quantize,
           "GLB with positions and normals of 16 bits (KHR_mesh_quantization)");
  add_flag(app, "--compress", arguments->compress,
           "GLB and 3D Tiles compressed without loss (EXT_meshopt_compression)");
  add_parsed(app, arguments->levels, parse_detail_levels,
             {"--levels", "auto|N",
              "Levels of detail of neuroglancer's format and 3D Tiles at most", "auto"});
  add_flag(app, "--sharded", arguments->sharded, "neuroglancer's format in few large files");
  add_parsed(
      app, arguments->normals, parse_normals,
      {"--normals", "gradient|none", "none: without those that the pieces have", "gradient"});
  add_filters(app, arguments->filters);
  add_attributes(app, arguments->attributes, arguments->colours);
  add_memory(app, arguments->memory);
  add_threads(app, arguments->threads);
  add_force(app, arguments->force);
  add_flag(app, "--no-space-check", arguments->no_space_check,
           "Begin even if the disk is too small");
  add_run(program, app, arguments, run_merge);
}

}  // namespace isobrick::tools
