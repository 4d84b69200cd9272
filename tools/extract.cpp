#include <isobrick/extract.h>

#include <cmath>
#include <filesystem>
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "bricks/level_set.h"
#include "bricks/zarr/metadata_files.h"
#include "io/bytes/output_guard.h"
#include "tools/extract_labels.h"
#include "tools/extract_part.h"
#include "tools/extract_plan.h"
#include "tools/job.h"
#include "tools/open_store.h"
#include "tools/output_name.h"
#include "tools/value_range.h"

namespace isobrick::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

/// The files of one surface; null where none was requested.
struct Sinks {
  std::unique_ptr<MeshSink> mesh, preview;
  AttributeSinks attributes;                                ///< before the mesh
  std::unique_ptr<MeshFilter> mesh_filter, preview_filter;  ///< before them; null without filters

  /// What the filters write to: the attributes are of the vertices that leave them.
  MeshSink* mesh_file() const {
    return attributes.attributes ? attributes.attributes.get() : mesh.get();
  }
  MeshSink* mesh_input() const { return mesh_filter ? mesh_filter.get() : mesh_file(); }
  MeshSink* preview_input() const { return preview_filter ? preview_filter.get() : preview.get(); }
  /// Before what the report is of.
  const MeshFilter* reported_filter() const {
    return mesh ? mesh_filter.get() : preview_filter.get();
  }
};

/// What a surface goes through before `sink`; null where that is nothing.
std::unique_ptr<MeshFilter> filter_before(MeshSink* sink, MeshFilterOptions options,
                                          const fs::path& path) {
  if (!sink || !options.any()) return nullptr;
  options.scratch_beside = path;
  return std::make_unique<MeshFilter>(*sink, options);
}

/// Opens every output before the first extraction, so that one that exists or
/// cannot be written stops the command at once.
std::vector<Sinks> open_sinks(const std::vector<ExtractedSurface>& surfaces,
                              const ExtractArguments& arguments, const AttributeVolumes& attributes,
                              Progress& progress) {
  const bool force = arguments.force;
  // Several may be finished at the same time.
  const bool is_only = surfaces.size() * arguments.outputs() == 1;
  std::vector<fs::path> inputs = paths_of(arguments.attributes);
  inputs.emplace_back(arguments.input.path);
  std::vector<Sinks> sinks;
  for (const ExtractedSurface& surface : surfaces) {
    check_replaces_no_input(surface.output, inputs);
    check_replaces_no_input(surface.preview, inputs);
    Sinks& of_surface = sinks.emplace_back();
    if (!surface.output.empty())
      of_surface.mesh =
          create_mesh_file(surface.output, {.format = surface.form.format,
                                            .quantize = surface.form.quantize,
                                            .compress = surface.form.compress,
                                            .levels = surface.form.levels,
                                            .sharded = surface.form.sharded,
                                            .force = force,
                                            .threads = arguments.threads,
                                            .memory = memory_of_mesh(surface, surfaces.size()),
                                            .progress = is_only ? &progress : nullptr});
    if (of_surface.mesh)
      of_surface.attributes =
          attributes.open(*of_surface.mesh, attributes.options(arguments.memory, surfaces.size()));
    if (!surface.preview.empty())
      of_surface.preview = open_preview(surface.preview.string(), force, arguments.preview);
    MeshFilterOptions filter = surface.filter;
    if (is_only) filter.progress = &progress;
    of_surface.mesh_filter = filter_before(of_surface.mesh_file(), filter, surface.output);
    filter.measure = filter.measure && !of_surface.mesh;  // once is enough
    filter.unit.clear();                                  // cameras know the volume's
    of_surface.preview_filter = filter_before(of_surface.preview.get(), filter, surface.preview);
  }
  return sinks;
}

/// Why a surface has no triangle.
std::string why_empty(const ExtractOptions& options, const ExtractReport& report,
                      const FilteredSurface& filtered, const StoreReader& store) {
  if (filtered.extracted.triangles > 0)
    return fmt::format("isovalue {}: no component is large enough for --min-component",
                       options.isovalue);
  const std::string empty = fmt::format("isovalue {}: the surface is empty", options.isovalue);
  if (report.degenerate_triangles > 0) return empty + ", all triangles are degenerate";
  return empty + "; " + range_text(store, options.level);
}

struct SurfaceReports {
  std::vector<ExtractReport> reports;  ///< of each mesh, or of the picture where there is no mesh
  std::vector<FilteredSurface> filtered;
  std::vector<PassReport> passes;
};

/// Makes all meshes and pictures.
SurfaceReports make(const std::vector<ExtractedSurface>& surfaces, const std::vector<Sinks>& sinks,
                    const StoreReader& store, Console& console) {
  std::vector<SurfaceOutput> outputs;
  std::vector<std::string> names;
  std::vector<std::size_t> reported;
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const ExtractOptions& options = surfaces[i].options;
    reported.push_back(outputs.size());
    if (sinks[i].mesh) {
      outputs.push_back({options.isovalue, options.normals, sinks[i].mesh_input()});
      names.push_back(surfaces[i].output.string());
    }
    if (sinks[i].preview) {
      outputs.push_back({options.isovalue, true, sinks[i].preview_input()});
      names.push_back(surfaces[i].preview.string());
    }
  }
  const std::vector<ExtractReport> reports =
      extract(store, surfaces.front().options, outputs, console.progress());
  SurfaceReports made;
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    ExtractReport report = reports[reported[i]];
    FilteredSurface filtered{.extracted = {report.vertices, report.triangles}};
    if (const MeshFilter* filter = sinks[i].reported_filter()) {
      report.vertices = filter->size().vertices;
      report.triangles = filter->size().triangles;
      filtered.measure = filter->measure();
      filtered.simplify_goal = filter->simplify_goal();
    }
    if (const auto* levels = dynamic_cast<const LevelSink*>(sinks[i].mesh.get()))
      filtered.levels = levels->levels();
    made.reports.push_back(report);
    made.filtered.push_back(filtered);
  }
  made.passes = passes_of(reports, names);
  return made;
}

CommandOutput estimate_all(const std::vector<ExtractedSurface>& surfaces, const StoreReader& store,
                           Console& console) {
  CommandOutput result;
  if (surfaces.front().filter.changes_mesh())
    console.note("the estimate is of the surface before it is filtered");
  for (const ExtractedSurface& surface : surfaces) {
    const ExtractEstimate guess = estimate_one(surface, store);
    result.objects.push_back(estimate_json(surface, guess));
    result.text += estimate_text(surface, guess);
    const ExtractOptions& options = surface.options;
    if (const std::string why = why_out_of_range(store, options.level, options.isovalue);
        guess.mesh.triangles == 0 && !why.empty())
      console.note(why);
  }
  return result;
}

CommandOutput make_all(const ExtractArguments& arguments,
                       const std::vector<ExtractedSurface>& surfaces, const StoreReader& store,
                       const AttributeVolumes& attributes, Console& console) {
  check_pictures(surfaces, arguments, store);
  if (!arguments.no_space_check) check_space(surfaces, store);
  const std::vector<Sinks> sinks = open_sinks(surfaces, arguments, attributes, console.progress());
  const SurfaceReports made = make(surfaces, sinks, store, console);
  CommandOutput result;
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const ExtractReport& report = made.reports[i];
    const FilteredSurface& filtered = made.filtered[i];
    if (report.triangles == 0)
      console.note(why_empty(surfaces[i].options, report, filtered, store));
    if (const std::string note = goal_note(report.triangles, filtered, surfaces[i].filter);
        !note.empty())
      console.note(note);
    const std::uint64_t bytes = !sinks[i].mesh ? 0
                                : is_standard_output(arguments.output)
                                    ? sinks[i].mesh->bytes()
                                    : mesh_bytes(surfaces[i].output);
    result.objects.push_back(report_json(surfaces[i], report, filtered, bytes));
    result.text += report_text(surfaces[i], report, filtered, bytes, surfaces.size() == 1);
  }
  result.passes = passes_json(made.passes);
  if (surfaces.size() > 1 || made.passes.size() > 1) result.text += passes_text(made.passes);
  return result;
}

/// Beyond its narrow band a level set does not change: what there is of a surface is no contour.
void note_band(double isovalue, const StoreInfo& info, Console& console) {
  const std::optional<double> band = narrow_band(info);
  if (!band || std::abs(isovalue) < *band) return;
  console.note(fmt::format(
      "isovalue {} lies outside of the narrow band of this level set, which has distances between "
      "{} and {}: choose one within",
      isovalue, -*band, *band));
}

void check_devices(const ExtractArguments& arguments) {
  if (arguments.devices.size() < 2) return;
  if (arguments.backend == Backend::cpu)
    throw UsageError("--device: several devices share the work of --backend cuda, not of the CPU");
  check_piece_arguments(arguments, "several devices");
}

int run_extract(const ExtractArguments& given, Console& console) {
  if (given.part)
    return given.labels ? run_extract_label_part(given, console) : run_extract_part(given, console);
  if (given.labels) return run_extract_labels(given, console);
  ExtractArguments arguments = with_preset(given);
  Ranks* const job = arguments.estimate ? nullptr : join_job(arguments.mpi, console);
  check_arguments(arguments);
  if (job == nullptr) check_devices(arguments);
  if (job != nullptr) {
    share_machine(*job, arguments.memory, arguments.threads);
    choose_device(*job, arguments);
  }
  const bool streams =
      is_standard_output(arguments.output) || is_standard_output(arguments.preview.path);
  if (streams && !arguments.estimate) console.reserve_output();
  if (!is_zarr(arguments.input.path)) check_outputs(arguments);
  const OpenedVolume input = open_shared_input(arguments, job, console);
  const StoreReader& store = input.store();
  choose_mesh_unit(arguments, store, console);
  const AttributeVolumes attributes(arguments.attributes, arguments.colours, arguments.input,
                                    arguments.memory, arguments.threads,
                                    store.info().levels.front().transform.unit, console);
  arguments.attribute_memory =
      attributes.memory(attributes.options(arguments.memory, arguments.isovalues.size()));
  const std::vector<ExtractedSurface> surfaces = plan_surfaces(arguments, store, console);
  for (const ExtractedSurface& surface : surfaces)
    note_band(surface.options.isovalue, store.info(), console);
  const bool by_pieces = arguments.resume || job != nullptr ||
                         (!arguments.estimate && arguments.devices.size() < 2 && !streams &&
                          arguments.preview.path.empty() && need_pieces(surfaces, store));
  const CommandOutput output =
      arguments.estimate             ? estimate_all(surfaces, store, console)
      : arguments.devices.size() > 1 ? make_on_devices(arguments, surfaces, store, console)
      : by_pieces                    ? make_by_pieces(arguments, surfaces, store, job, console)
                                     : make_all(arguments, surfaces, store, attributes, console);
  ordered_json result{{"command", "extract"},
                      {"input", arguments.input.path},
                      {"level", surfaces.front().options.level},
                      {"estimate", arguments.estimate},
                      {"surfaces", output.objects}};
  if (!arguments.estimate) {
    result["passes"] = output.passes;
    if (arguments.devices.size() > 1) result["devices"] = arguments.devices;
  }
  add_peak(job, result);
  console.result(result, output.text);
  return 0;
}

/// "auto" (nothing) or a number.
std::optional<int> parse_level(const std::string& text) {
  if (text == "auto") return std::nullopt;
  return parse_int(text, 0, 64);
}

std::vector<int> parse_devices(const std::string& text) {
  std::vector<int> devices;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const int device = parse_int(std::string_view(text).substr(begin, end - begin), 0, 255);
    if (std::find(devices.begin(), devices.end(), device) != devices.end())
      throw UsageError(fmt::format("device {} is named twice", device));
    devices.push_back(device);
    begin = end + 1;
  }
  return devices;
}

void add_backend_options(CLI::App* app, ExtractArguments& arguments) {
  add_parsed(
      app, arguments.backend, parse_backend,
      {"--backend", "auto|cpu|cuda",
       "What makes the surface, the same on either; auto: a GPU where that is faster", "auto"});
  add_parsed(app, arguments.gpu_memory, parse_bytes,
             {"--gpu-memory", "BYTES", "Budget of device memory, such as 512M or 1.5G",
              "what is free less 10 %"});
  add_parsed(app, arguments.devices, parse_devices,
             {"--device", "N,...",
              "Which CUDA device, the first is 0; several, as in 0,1, share the work by way of "
              "pieces",
              "0; of ranks each its own"});
}

void add_level_options(CLI::App* app, ExtractArguments& arguments) {
  add_text(
      app,
      {"--level", "auto|L",
       "Level of the pyramid, 0 the finest; auto: the finest with at most --max-triangles", "0"},
      [&arguments](const std::string& text) {
        arguments.level = parse_level(text);
        arguments.level_given = true;
      });
  add_parsed(
      app, arguments.max_triangles,
      [](const std::string& text) { return std::optional(parse_count(text)); },
      {"--max-triangles", "N",
       "Choose the finest level whose surfaces have about so many triangles at most, such as "
       "500k or 2M",
       "20M with --level auto"});
}

void add_outputs(CLI::App* app, ExtractArguments& arguments) {
  add_output(
      app, arguments.output, "MESH",
      "Mesh to write, .ply, .stl, .obj, .glb, .vtp, .pvtp, .neuroglancer or .3dtiles; several "
      "isovalues make head_500.ply and so on; - for standard output",
      "head_500.ply of head.zarr, unless --preview or --estimate is all");
  add_parsed(app, arguments.format, parse_mesh_format,
             {"--format", "ply|stl|obj|glb|vtp|pvtp|neuroglancer|3dtiles", "Format of the mesh",
              "by its extension, or ply"});
  add_flag(app, "--quantize", arguments.quantize,
           "GLB with positions and normals of 16 bits (KHR_mesh_quantization)");
  add_flag(app, "--compress", arguments.compress,
           "GLB and 3D Tiles compressed without loss (EXT_meshopt_compression)");
  add_parsed(app, arguments.levels, parse_detail_levels,
             {"--levels", "auto|N",
              "Levels of detail of neuroglancer's format and 3D Tiles at most, each with a quarter "
              "of the triangles of the one before; auto: until one part has the whole mesh",
              "auto"});
  add_flag(app, "--sharded", arguments.sharded,
           "neuroglancer's format in few large files, in place of two for each mesh");
  add_text(app, {"--preview", "PNG", "Draw a shaded picture of the surface; - for standard output"},
           [&preview = arguments.preview.path](const std::string& text) { preview = text; });
  add_picture_size(app, arguments.preview.size);
  add_camera(app, arguments.preview.camera);
  add_flag(app, "--estimate", arguments.estimate,
           "Write nothing; predict triangles, vertices, bytes and memory");
}

}  // namespace

OpenedVolume open_shared_input(const ExtractArguments& arguments, Ranks* job, Console& console,
                               std::optional<Downsampling> downsampling) {
  const auto open = [&] {
    return open_input(arguments.input, arguments.memory, arguments.threads, console, true,
                      downsampling);
  };
  if (job == nullptr) return open();
  // A conversion of each rank would cost more than the surface.
  check_store(arguments.input.path);
  if (job->rank() > 0) job->wait_for_all();
  OpenedVolume input = open();
  if (job->rank() == 0) job->wait_for_all();
  return input;
}

void add_extract(Program& program) {
  auto arguments = std::make_shared<ExtractArguments>();
  CLI::App* app =
      add_subcommand(program, "extract", "Write isosurfaces of a volume as welded triangle meshes.",
                     "isobrick extract head.zarr --isovalue 500,1150 -o head.ply\n"
                     "  isobrick extract head.zarr --isovalue otsu   # writes head_487.5.ply");
  add_input(app, arguments->input);
  add_isovalues(app, arguments->isovalues, "Value that the surface passes through");
  add_parsed(
      app, arguments->labels,
      [](const std::string& text) { return std::optional(parse_labels(text)); },
      {"--labels", "all|ID,A:B",
       "In place of isosurfaces, a closed mesh of each label of a segmentation, in the folder -o: "
       "of all but 0, or of these, such as 3,7,10:20"});
  add_outputs(app, *arguments);
  add_parsed(app, arguments->part,
             [](const std::string& text) { return std::optional(parse_part(text)); },
             {"--part", "I/N",
              "Make part I of N of the mesh, a piece that 'isobrick merge' puts together with the "
              "others; one that is there is kept"});
  add_level_options(app, *arguments);
  add_region(app, arguments->region);
  add_inside(app, arguments->inside);
  add_parsed(app, arguments->normals, parse_normals,
             {.name = "--normals",
              .value = "gradient|none",
              .help = "Normals at the vertices",
              .fallback = "gradient where the format holds them",
              .may_be_bare = true});
  add_flag(app, "--drop-degenerate", arguments->drop_degenerate,
           "Leave out triangles without area where samples equal the isovalue");
  add_parsed(app, arguments->topology, parse_topology,
             {"--topology", "consistent|trilinear",
              "How the surface passes where corners allow several ways: by a rule for faces, or as "
              "the trilinear interpolant does, tunnels included",
              "consistent"});
  add_flag(app, "--cap", arguments->cap,
           "Close the surface at the border of the volume or region and around missing samples");
  add_filters(app, arguments->filters);
  add_attributes(app, arguments->attributes, arguments->colours);
  add_text(
      app,
      {"--preset", "print",
       "For 3-D printing: --cap --largest 1 --smooth 10 --simplify 500k --mesh-unit mm, as STL; "
       "what is given otherwise stays"},
      [&for_print = arguments->for_print](const std::string& text) {
        if (text != "print") throw UsageError(fmt::format("'{}' is no preset; it is print", text));
        for_print = true;
      });
  add_search(app, arguments->search);
  add_memory(app, arguments->memory);
  add_threads(app, arguments->threads);
  add_backend_options(app, *arguments);
  add_flag(app, "--resume", arguments->resume,
           "Make the mesh by way of pieces in a folder beside it, and go on with those that an "
           "interrupted run left");
  add_mpi(app, arguments->mpi);
  add_force(app, arguments->force);
  add_flag(app, "--no-space-check", arguments->no_space_check,
           "Begin even if, by the estimate, the disk is too small");
  add_run(program, app, arguments, run_extract);
}

}  // namespace isobrick::tools
