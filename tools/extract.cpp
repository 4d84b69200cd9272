#include <isobrick/extract.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <isobrick/estimate.h>
#include "bricks/level_set.h"
#include "io/bytes/output_guard.h"
#include "pipeline/program_memory.h"
#include "tools/extract_report.h"
#include "tools/format.h"
#include "tools/index_options.h"
#include "tools/mesh_output.h"
#include "tools/mesh_space.h"
#include "tools/open_store.h"
#include "tools/options.h"
#include "tools/output_name.h"
#include "tools/pictures.h"
#include "tools/store_region.h"
#include "tools/value_range.h"

namespace isobrick::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct Arguments {
  std::string store;
  std::vector<double> isovalues;
  std::string output, preview;
  std::optional<MeshFormat> format;  ///< of the output; nothing: by its name
  bool quantize = false;
  PreviewOptions picture;
  int level = 0;
  std::optional<RoiText> roi;
  Selection selection;
  std::optional<Inside> inside;
  std::optional<bool> normals;  ///< nothing: where the format holds them
  bool drop_degenerate = false;
  std::uint64_t memory = std::uint64_t{1} << 30;
  int threads = 0;
  IndexChoice index;
  Backend backend = Backend::automatic;
  std::uint64_t gpu_memory = 0;
  int device = 0;
  bool estimate = false, force = false, no_space_check = false;
};

/// `path`, with the isovalue in its name when there are several.
fs::path named(const std::string& path, const Arguments& arguments, double isovalue) {
  if (path.empty() || arguments.isovalues.size() == 1) return path;
  return with_isovalue(path, isovalue);
}

/// How the mesh is written, or would be if it had a name.
MeshForm form_of(const Arguments& arguments) {
  MeshForm form{.quantize = arguments.quantize};
  if (arguments.format)
    form.format = *arguments.format;
  else if (!arguments.output.empty())
    form.format = mesh_format(arguments.output);
  if (!arguments.output.empty()) check_mesh_name(arguments.output, form.format);
  form.normals = arguments.normals.value_or(has_normals(form.format));
  if (form.quantize && form.format != MeshFormat::glb)
    throw UsageError(
        fmt::format("--quantize is for GLB only, and this mesh becomes {}", name_of(form.format)));
  return form;
}

/// Refuses two outputs that would replace each other.
void check_names(const Arguments& arguments) {
  std::vector<fs::path> names;
  for (const std::string& path : {arguments.output, arguments.preview})
    for (const double isovalue : arguments.isovalues) {
      if (path.empty()) continue;
      const fs::path name = named(path, arguments, isovalue);
      std::error_code failure;
      const fs::path canonical = fs::weakly_canonical(fs::absolute(name, failure), failure);
      names.push_back(failure ? name : canonical);
    }
  std::sort(names.begin(), names.end());
  const auto twice = std::adjacent_find(names.begin(), names.end());
  if (twice != names.end())
    throw UsageError(fmt::format("two outputs would have the name '{}'", twice->string()));
}

void check(const Arguments& arguments) {
  if (arguments.output.empty() && arguments.preview.empty() && !arguments.estimate)
    throw UsageError("nothing to do: give -o MESH, --preview PNG or --estimate");
  form_of(arguments);
  std::vector<double> sorted = arguments.isovalues;
  std::sort(sorted.begin(), sorted.end());
  const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
  if (twice != sorted.end()) throw UsageError(fmt::format("isovalue {} is given twice", *twice));
  check_names(arguments);
  if (!arguments.preview.empty()) check_picture_name(arguments.preview);
  if (is_standard_output(arguments.output) && arguments.isovalues.size() > 1)
    throw UsageError("standard output takes one mesh; give one --isovalue, or name a file");
}

std::vector<ExtractedSurface> plan(const Arguments& arguments, const StoreReader& store) {
  ExtractOptions options;
  options.level = arguments.level;
  options.roi = store_region(store, arguments.level, arguments.roi);
  options.inside = arguments.inside;
  options.drop_degenerate = arguments.drop_degenerate;
  // The driver is there from when a picture is opened, before anything is extracted.
  if (!arguments.preview.empty() && !arguments.estimate)
    options.memory_of_others = preview_driver_memory();
  options.memory = arguments.memory - std::min(arguments.memory, options.memory_of_others);
  options.threads = arguments.threads;
  options.index = arguments.index;
  options.backend = arguments.backend;
  options.gpu_memory = arguments.gpu_memory;
  options.device = arguments.device;
  const MeshForm form = form_of(arguments);
  options.normals = form.normals;
  std::vector<ExtractedSurface> surfaces;
  for (const double isovalue : arguments.isovalues) {
    options.isovalue = isovalue;
    surfaces.push_back({options, form, named(arguments.output, arguments, isovalue),
                        named(arguments.preview, arguments, isovalue)});
  }
  return surfaces;
}

/// Of the budget, what the mesh of a surface may use to hold what it writes later.
std::uint64_t memory_of_mesh(const ExtractedSurface& surface, const Arguments& arguments) {
  return surface.options.memory / arguments.isovalues.size();
}

/// The meshes to write, with the size_of(number of a surface) that PlannedMesh has.
template <class F>
std::vector<PlannedMesh> planned_meshes(const std::vector<ExtractedSurface>& surfaces,
                                        const F& size_of) {
  std::vector<PlannedMesh> meshes;
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const ExtractedSurface& surface = surfaces[i];
    if (surface.output.empty() || is_standard_output(surface.output.native())) continue;
    PlannedMesh mesh = size_of(i);
    mesh.path = surface.output;
    mesh.form = surface.form;
    meshes.push_back(std::move(mesh));
  }
  return meshes;
}

ExtractEstimate estimate_one(const ExtractedSurface& surface, const StoreReader& store) {
  return estimate(
      store, surface.options,
      mesh_file_memory(surface.form.format, surface.options.threads, surface.options.memory));
}

/// Refuses meshes that cannot fit their disk, before anything is written.
void check_space(const std::vector<ExtractedSurface>& surfaces, const StoreReader& store) {
  // Mostly all that the active cells could hold fits, which is known without a sample.
  std::vector<double> isovalues;
  for (const ExtractedSurface& surface : surfaces) isovalues.push_back(surface.options.isovalue);
  const std::vector<ActiveParts> active = count_active(store, surfaces.front().options, isovalues);
  const auto largest = planned_meshes(
      surfaces, [&](std::size_t i) { return PlannedMesh{.size = largest_mesh(active[i])}; });
  if (!find_shortage(largest, free_space)) return;
  const auto likely = planned_meshes(surfaces, [&](std::size_t i) {
    const ExtractEstimate guess = estimate_one(surfaces[i], store);
    return PlannedMesh{.size = guess.mesh, .uncertainty = guess.uncertainty};
  });
  if (const auto shortage = find_shortage(likely, free_space))
    throw Error(fmt::format(
        "'{}' would have about {} triangles and need {}, but its disk has {} free; choose "
        "another disk, a coarser --level or an --roi (or --no-space-check, should the estimate "
        "be wrong)",
        likely[shortage->mesh].path.string(), human_count(likely[shortage->mesh].size.triangles),
        human_bytes(shortage->needed), human_bytes(shortage->free)));
}

/// The files of one surface; null where none was requested.
struct Sinks {
  std::unique_ptr<MeshSink> mesh, preview;
};

/// Opens every output before the first extraction, so that one that exists or
/// cannot be written stops the command at once.
std::vector<Sinks> open_sinks(const std::vector<ExtractedSurface>& surfaces,
                              const Arguments& arguments) {
  const bool force = arguments.force;
  const std::array<fs::path, 1> inputs{arguments.store};
  std::vector<Sinks> sinks;
  for (const ExtractedSurface& surface : surfaces) {
    check_replaces_no_input(surface.output, inputs);
    check_replaces_no_input(surface.preview, inputs);
    Sinks& of_surface = sinks.emplace_back();
    if (!surface.output.empty())
      of_surface.mesh =
          create_mesh_file(surface.output, {.format = surface.form.format,
                                            .quantize = surface.form.quantize,
                                            .force = force,
                                            .threads = arguments.threads,
                                            .memory = memory_of_mesh(surface, arguments)});
    if (!surface.preview.empty())
      of_surface.preview = open_preview(surface.preview.string(), force, arguments.picture);
  }
  return sinks;
}

/// Why a surface has no triangle.
std::string why_empty(const ExtractOptions& options, const ExtractReport& report,
                      const StoreReader& store) {
  const std::string empty = fmt::format("isovalue {}: the surface is empty", options.isovalue);
  if (report.degenerate_triangles > 0) return empty + ", all triangles are degenerate";
  return empty + "; " + range_text(store, options.level);
}

/// The least budget of the whole command for a surface with a picture.
std::uint64_t min_with_picture(const ExtractedSurface& surface, const Arguments& arguments,
                               const StoreReader& store) {
  ExtractOptions picture = surface.options;
  picture.normals = true;
  std::uint64_t least =
      min_extract_memory(store, picture, Indexing::chunk_local, preview_memory(arguments.picture));
  if (!surface.output.empty())
    least =
        std::max(least, min_extract_memory(store, surface.options, Indexing::welded,
                                           mesh_file_memory(surface.form.format, arguments.threads,
                                                            memory_of_mesh(surface, arguments))));
  return surface.options.memory_of_others + least;
}

/// Refuses a budget in which pictures cannot be drawn, before anything is extracted.
void check_pictures(const std::vector<ExtractedSurface>& surfaces, const Arguments& arguments,
                    const StoreReader& store) {
  for (const ExtractedSurface& surface : surfaces) {
    if (surface.preview.empty()) continue;
    const std::uint64_t least = min_with_picture(surface, arguments, store);
    if (arguments.memory < least)
      throw UsageError(fmt::format(
          "a memory budget of {:.1f} MiB is too small: with a picture of {} x {} pixels at least "
          "--memory {}M is needed, {:.1f} MiB of it for the picture and OpenGL's driver; or "
          "choose a smaller --preview-size",
          in_mib(arguments.memory), arguments.picture.width, arguments.picture.height,
          mib_above(least), in_mib(preview_memory(arguments.picture) + preview_driver_memory())));
  }
}

struct SurfaceReports {
  std::vector<ExtractReport> reports;  ///< of each mesh, or of the picture where there is no mesh
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
      outputs.push_back({options.isovalue, options.normals, sinks[i].mesh.get()});
      names.push_back(surfaces[i].output.string());
    }
    if (sinks[i].preview) {
      outputs.push_back({options.isovalue, true, sinks[i].preview.get()});
      names.push_back(surfaces[i].preview.string());
    }
  }
  const std::vector<ExtractReport> reports =
      extract(store, surfaces.front().options, outputs, console.progress());
  SurfaceReports made;
  for (const std::size_t i : reported) made.reports.push_back(reports[i]);
  made.passes = passes_of(reports, names);
  return made;
}

/// Reports each surface.
struct CommandOutput {
  ordered_json objects = ordered_json::array(), passes;  ///< no passes of an estimate
  std::string text;
};

CommandOutput estimate_all(const std::vector<ExtractedSurface>& surfaces, const StoreReader& store,
                           Console& console) {
  CommandOutput result;
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

CommandOutput make_all(const Arguments& arguments, const std::vector<ExtractedSurface>& surfaces,
                       const StoreReader& store, Console& console) {
  check_pictures(surfaces, arguments, store);
  if (!arguments.no_space_check) check_space(surfaces, store);
  const std::vector<Sinks> sinks = open_sinks(surfaces, arguments);
  const SurfaceReports made = make(surfaces, sinks, store, console);
  CommandOutput result;
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const ExtractReport& report = made.reports[i];
    if (report.triangles == 0) console.note(why_empty(surfaces[i].options, report, store));
    const std::uint64_t bytes = !sinks[i].mesh ? 0
                                : is_standard_output(arguments.output)
                                    ? sinks[i].mesh->bytes()
                                    : mesh_bytes(surfaces[i].output);
    result.objects.push_back(report_json(surfaces[i], report, bytes));
    result.text += report_text(surfaces[i], report, bytes, surfaces.size() == 1);
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

int run(const Arguments& arguments, Console& console) {
  check(arguments);
  if (is_standard_output(arguments.output) && !arguments.estimate) console.reserve_output();
  const StoreReader store = open_store(arguments.store, arguments.selection);
  const std::vector<ExtractedSurface> surfaces = plan(arguments, store);
  for (const double isovalue : arguments.isovalues) note_band(isovalue, store.info(), console);
  const CommandOutput output = arguments.estimate ? estimate_all(surfaces, store, console)
                                                  : make_all(arguments, surfaces, store, console);
  ordered_json result{{"command", "extract"},
                      {"store", arguments.store},
                      {"level", arguments.level},
                      {"estimate", arguments.estimate},
                      {"surfaces", output.objects}};
  if (!arguments.estimate) result["passes"] = output.passes;
  result["peak_resident_bytes"] = peak_resident_bytes();
  console.result(result, output.text);
  return 0;
}

bool parse_normals(const std::string& text) {
  if (text == "gradient") return true;
  if (text == "none") return false;
  throw UsageError(fmt::format("'{}' is no kind of normals; it is gradient or none", text));
}

void add_backend_options(CLI::App* app, Arguments& arguments) {
  add_parsed(
      app, arguments.backend, parse_backend,
      {"--backend", "auto|cpu|cuda",
       "What makes the surface, the same on either; auto: a GPU where that is faster", "auto"});
  add_parsed(app, arguments.gpu_memory, parse_bytes,
             {"--gpu-memory", "BYTES", "Budget of device memory, such as 512M or 1.5G",
              "what is free less 10 %"});
  add_parsed(app, arguments.device, [](const std::string& text) { return parse_int(text, 0, 255); },
             {"--device", "N", "Which CUDA device, the first is 0", "0"});
}

void add_preview_options(CLI::App* app, Arguments& arguments) {
  PreviewOptions& picture = arguments.picture;
  add_text(app, {"--preview", "PNG", "Draw a shaded picture of the surface"},
           [&preview = arguments.preview](const std::string& text) { preview = text; });
  add_text(app, {"--preview-size", "WxH", "Size of the picture, pixels", "1280x960"},
           [&picture](const std::string& text) {
             const PictureSize size = parse_picture_size(text);
             picture.width = size.width;
             picture.height = size.height;
           });
  add_parsed(
      app, picture.towards_eye, parse_vector,
      {"--preview-eye", "X,Y,Z", "From the surface's centre towards the eye", "0.55,-1,0.5"});
  add_parsed(app, picture.up, parse_vector,
             {"--preview-up", "X,Y,Z", "What is up in the picture", "0,0,1"});
}

}  // namespace

void add_extract(Program& program) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* app =
      add_subcommand(program, "extract", "Write isosurfaces of a store as welded triangle meshes.",
                     "isobrick extract head.zarr --isovalue 500 --isovalue 1150 -o head.ply");
  add_path(app, "STORE", arguments->store, "Store to read");
  add_repeated(
      app, {"--isovalue", "V", "Value that the surface passes through; may be repeated", "", true},
      [&isovalues = arguments->isovalues](const std::string& text) {
        isovalues.push_back(parse_number(text));
      });
  add_text(app,
           {"-o,--output", "MESH",
            "Mesh to write, .ply, .stl, .obj, .glb, .vtp or .pvtp; several isovalues make "
            "head_500.ply and so on; - with --format obj for standard output (this, --preview "
            "or --estimate is needed)"},
           [&output = arguments->output](const std::string& text) { output = text; });
  add_parsed(app, arguments->format, parse_mesh_format,
             {"--format", "ply|stl|obj|glb|vtp|pvtp", "Format of the mesh", "by its extension"});
  add_flag(app, "--quantize", arguments->quantize,
           "GLB with positions and normals of 16 bits (KHR_mesh_quantization)");
  add_preview_options(app, *arguments);
  add_flag(app, "--estimate", arguments->estimate,
           "Write nothing; predict triangles, vertices, bytes and memory");
  add_level(app, arguments->level);
  add_roi(app, arguments->roi);
  add_selection(app, arguments->selection);
  add_inside(app, arguments->inside);
  add_parsed(app, arguments->normals, parse_normals,
             {.name = "--normals",
              .value = "gradient|none",
              .help = "Normals at the vertices",
              .fallback = "gradient where the format holds them",
              .may_be_bare = true});
  add_flag(app, "--drop-degenerate", arguments->drop_degenerate,
           "Leave out triangles without area where samples equal the isovalue");
  add_parsed(app, arguments->index, parse_index_choice,
             {"--index", "auto|none|interval|kdtree|quadtree|octree",
              "How active blocks are found; never shows in the mesh", "auto"});
  add_memory(app, arguments->memory);
  add_threads(app, arguments->threads);
  add_backend_options(app, *arguments);
  add_force(app, arguments->force);
  add_flag(app, "--no-space-check", arguments->no_space_check,
           "Begin even if, by the estimate, the disk is too small");
  add_run(program, app, arguments, run);
}

}  // namespace isobrick::tools
