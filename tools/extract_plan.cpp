#include "tools/extract_plan.h"

#include <algorithm>
#include <filesystem>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "io/bytes/folder_walk.h"
#include "io/bytes/leftovers.h"
#include "pipeline/pieces/merge_limit.h"
#include "pipeline/program_memory.h"
#include "tools/format.h"
#include "tools/isovalues.h"
#include "tools/mesh_output.h"
#include "tools/mesh_space.h"
#include "tools/output_name.h"
#include "tools/store_region.h"

namespace isobrick::tools {
namespace {

namespace fs = std::filesystem;

/// Triangles of --level auto where no number is given.
constexpr std::uint64_t kAutomaticTriangles = 20'000'000;

/// A folder's name without the slash that it may end in.
fs::path plain_name(const fs::path& path, MeshFormat format) {
  return has_levels(format) ? without_slash(path) : path;
}

/// `path`, with the isovalue in its name when there are several.
fs::path named(const std::string& path, double isovalue, std::size_t count) {
  if (path.empty() || count == 1) return path;
  return with_isovalue(path, isovalue);
}

/// The name of the mesh where none is given: the input's in the current folder, with the isovalue.
fs::path default_output(const ExtractArguments& arguments, MeshFormat format, double isovalue) {
  return with_isovalue(stem_of_input(arguments.input.path, arguments.input.volume) +
                           std::string(extension_of(format)),
                       isovalue);
}

/// How the mesh is written, or would be if it had a name.
MeshForm form_of(const ExtractArguments& arguments) {
  MeshForm form = with_format({.quantize = arguments.quantize,
                               .compress = arguments.compress,
                               .levels = arguments.levels,
                               .sharded = arguments.sharded,
                               .attributes = arguments.attributes.size(),
                               .colours = !arguments.colours.attribute.empty()},
                              arguments.format, arguments.output);
  form.normals = arguments.normals.value_or(has_normals(form.format));
  return form;
}

/// Refuses two outputs that would replace each other.
void check_names(const std::vector<ExtractedSurface>& surfaces) {
  std::vector<fs::path> names;
  for (const ExtractedSurface& surface : surfaces)
    for (const fs::path& name : {surface.output, surface.preview}) {
      if (name.empty()) continue;
      std::error_code failure;
      const fs::path canonical = fs::weakly_canonical(fs::absolute(name, failure), failure);
      names.push_back(failure ? name : canonical);
    }
  std::sort(names.begin(), names.end());
  const auto twice = std::adjacent_find(names.begin(), names.end());
  if (twice != names.end())
    throw UsageError(fmt::format("two outputs would have the name '{}'", twice->string()));
}

std::vector<double> isovalues_of(const ExtractArguments& arguments, const StoreReader& store,
                                 Console& console) {
  if (arguments.isovalues.empty()) {
    const auto suggested = suggest_isovalue_of(store, console);
    if (!suggested)
      throw UsageError(
          "--isovalue is missing, and no surface passes between the samples: all are the same, or "
          "none is a finite number");
    throw UsageError(fmt::format("--isovalue is missing; try --isovalue {}: {}", suggested->value,
                                 suggested->why));
  }
  std::vector<double> isovalues = resolve_isovalues(arguments.isovalues, store, console);
  const bool streams =
      is_standard_output(arguments.output) || is_standard_output(arguments.preview.path);
  if (streams && isovalues.size() > 1)
    throw UsageError("standard output takes one surface; give one --isovalue, or name a file");
  return isovalues;
}

/// What all surfaces share, but for the level and the region in it.
ExtractOptions common_options(const ExtractArguments& arguments) {
  ExtractOptions options;
  options.inside = arguments.inside;
  options.drop_degenerate = arguments.drop_degenerate;
  options.topology = arguments.topology;
  options.cap = arguments.cap;
  // The driver is there from when a picture is opened, before anything is extracted.
  if (!arguments.preview.path.empty() && !arguments.estimate)
    options.memory_of_others = preview_driver_memory();
  options.memory = arguments.memory - std::min(arguments.memory, options.memory_of_others);
  options.threads = arguments.threads;
  options.index = arguments.search;
  options.backend = arguments.backend;
  options.gpu_memory = arguments.gpu_memory;
  if (!arguments.devices.empty()) options.device = arguments.devices.front();
  options.normals = form_of(arguments).normals;
  return options;
}

/// What the filters of a sink hold.
std::uint64_t filter_memory(const ExtractedSurface& surface) {
  return surface.filter.any() ? surface.filter.memory : 0;
}

/// The least budget of an extraction for the mesh of a surface.
std::uint64_t min_of_mesh(const ExtractedSurface& surface, std::size_t surfaces,
                          const ExtractArguments& arguments, const StoreReader& store) {
  return min_extract_memory(
      store, surface.options, Indexing::welded,
      filter_memory(surface) + surface.attribute_memory +
          memory_of_file(surface.form, arguments.threads, memory_of_mesh(surface, surfaces)));
}

/// The same for its picture.
std::uint64_t min_of_picture(const ExtractedSurface& surface, const ExtractArguments& arguments,
                             const StoreReader& store) {
  ExtractOptions picture = surface.options;
  picture.normals = true;
  return min_extract_memory(store, picture,
                            surface.filter.any() ? Indexing::welded : Indexing::chunk_local,
                            filter_memory(surface) + preview_memory(arguments.preview));
}

/// The least budget of the whole command for a surface with a picture.
std::uint64_t min_with_picture(const ExtractedSurface& surface, std::size_t surfaces,
                               const ExtractArguments& arguments, const StoreReader& store) {
  std::uint64_t least = min_of_picture(surface, arguments, store);
  if (!surface.output.empty())
    least = std::max(least, min_of_mesh(surface, surfaces, arguments, store));
  return surface.options.memory_of_others + least;
}

/// Filters get half of what an extraction does not need, and work with little.
void share_filter_memory(std::vector<ExtractedSurface>& surfaces, const ExtractArguments& arguments,
                         const StoreReader& store) {
  constexpr std::uint64_t least = std::uint64_t{8} << 20;
  const std::uint64_t outputs = surfaces.size() * arguments.outputs();
  for (ExtractedSurface& surface : surfaces) {
    if (!surface.filter.any()) return;
    surface.filter.memory = least;
    const std::uint64_t needed =
        std::max(min_of_mesh(surface, surfaces.size(), arguments, store),
                 surface.preview.empty() ? 0 : min_of_picture(surface, arguments, store));
    const std::uint64_t budget = surface.options.memory;
    surface.filter.memory += (budget - std::min(budget, needed)) / 2 / outputs;
  }
}

std::vector<ExtractedSurface> surfaces_of_level(const ExtractArguments& arguments,
                                                const StoreReader& store, int level,
                                                const std::vector<double>& isovalues) {
  ExtractOptions options = common_options(arguments);
  options.level = level;
  options.roi = store_region(store, level, arguments.region);
  const MeshForm form = form_of(arguments);
  MeshFilterOptions filter = filter_options(arguments.filters);
  filter.threads = arguments.threads;
  const std::vector<std::string> names = names_of(arguments.attributes);
  std::vector<ExtractedSurface> surfaces;
  for (const double isovalue : isovalues) {
    options.isovalue = isovalue;
    const fs::path output =
        !arguments.output.empty()
            ? plain_name(named(arguments.output, isovalue, isovalues.size()), form.format)
        : arguments.writes_mesh() ? default_output(arguments, form.format, isovalue)
                                  : fs::path();
    surfaces.push_back({options, form, output,
                        named(arguments.preview.path, isovalue, isovalues.size()), filter,
                        arguments.attribute_memory, names});
  }
  if (!arguments.estimate) share_filter_memory(surfaces, arguments, store);
  return surfaces;
}

/// The finest level whose surfaces have few enough triangles together, else the coarsest.
std::vector<ExtractedSurface> surfaces_of_fitting_level(const ExtractArguments& arguments,
                                                        const StoreReader& store,
                                                        const std::vector<double>& isovalues,
                                                        Console& console) {
  if (arguments.region.roi)
    throw UsageError("--roi counts the samples of one level: give --level, or a --region");
  const std::uint64_t limit = arguments.max_triangles.value_or(kAutomaticTriangles);
  const auto levels = static_cast<int>(store.info().levels.size());
  for (int level = 0;; ++level) {
    std::vector<ExtractedSurface> surfaces = surfaces_of_level(arguments, store, level, isovalues);
    std::uint64_t triangles = 0;
    for (const ExtractedSurface& surface : surfaces)
      triangles += estimate_one(surface, store).mesh.triangles;
    const bool fits = triangles <= limit;
    if (!fits && level + 1 < levels) continue;
    console.note(fmt::format("level {} of {}: about {} triangles{}", level, levels,
                             human_count(triangles),
                             fits ? "" : ", more than requested; no level is coarser"));
    return surfaces;
  }
}

/// Where a mesh grows, whose disk must have room; nothing where it only passes through.
fs::path disk_of(const ExtractedSurface& surface) {
  if (!is_standard_output(surface.output.native())) return surface.output;
  return surface.form.format == MeshFormat::obj ? fs::path() : temporary_folder() / "isobrick";
}

/// The meshes to write, with the size_of(number of a surface) that PlannedMesh has.
template <class F>
std::vector<PlannedMesh> planned_meshes(const std::vector<ExtractedSurface>& surfaces,
                                        const F& size_of) {
  std::vector<PlannedMesh> meshes;
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const ExtractedSurface& surface = surfaces[i];
    const fs::path path = disk_of(surface);
    if (path.empty()) continue;
    PlannedMesh mesh = size_of(i);
    mesh.path = path;
    mesh.form = surface.form;
    mesh.filter = surface.filter;
    meshes.push_back(std::move(mesh));
  }
  return meshes;
}

/// `waits`: for standard output, in a temporary file.
std::string shortage_text(const PlannedMesh& mesh, const Shortage& shortage, bool waits) {
  return fmt::format(
      "'{}' would have about {} triangles and need {}, but {} has {} free; choose another "
      "disk{}, a coarser --level or an --roi (or --no-space-check, should the estimate be wrong)",
      waits ? "-" : mesh.path.string(), human_count(mesh.size.triangles),
      human_bytes(shortage.needed), waits ? "the disk of temporary files" : "its disk",
      human_bytes(shortage.free),
      waits ? fmt::format(" (TMPDIR, now '{}')", mesh.path.parent_path().string()) : "");
}

/// Refuses attributes that no file could hold.
void check_attributes(const ExtractArguments& arguments) {
  check_attributes(arguments.attributes, arguments.colours);
  if (!arguments.attributes.empty() && !arguments.estimate && !arguments.writes_mesh())
    throw UsageError("--attribute: a picture has none; name a mesh with -o");
}

}  // namespace

ExtractArguments with_preset(ExtractArguments arguments) {
  if (!arguments.for_print) return arguments;
  arguments.cap = true;
  set_for_print(arguments.filters);
  const bool is_named = !arguments.output.empty() && !is_standard_output(arguments.output);
  if (!is_named && !arguments.format) arguments.format = MeshFormat::stl;
  return arguments;
}

void choose_mesh_unit(ExtractArguments& arguments, const StoreReader& store, Console& console) {
  std::string& unit = arguments.filters.unit;
  const bool is_known = !store.info().levels.front().transform.unit.empty();
  if (!unit.empty() && !is_known)
    throw UsageError(
        "--mesh-unit: the volume does not say its unit of length; convert it with --unit");
  if (!arguments.for_print || !unit.empty()) return;
  if (is_known)
    unit = "millimeter";
  else
    console.note(
        "the volume does not say its unit of length, so the mesh is as if it were millimetres");
}

void check_arguments(const ExtractArguments& arguments) {
  for (const std::string& output : {arguments.output, arguments.preview.path})
    refuse_url_output(output);
  form_of(arguments);
  check_attributes(arguments);
  check_filters(arguments.filters, arguments.estimate);
  if (is_standard_output(arguments.output) && is_standard_output(arguments.preview.path))
    throw UsageError("standard output takes a mesh or a picture; name a file for one of them");
  if (!arguments.output.empty() && !arguments.preview.path.empty())
    check_names({{.output = arguments.output, .preview = arguments.preview.path}});
  for (auto request = arguments.isovalues.begin(); request != arguments.isovalues.end(); ++request)
    if (!needs_histogram(*request) &&
        std::find(arguments.isovalues.begin(), request, *request) != request)
      throw UsageError(fmt::format("isovalue {} is given twice", request->number));
  if (arguments.max_triangles && arguments.level && arguments.level_given)
    throw UsageError("--max-triangles chooses the level: leave --level out");
  if (!arguments.preview.path.empty()) check_picture_name(arguments.preview.path);
}

void check_outputs(const ExtractArguments& arguments) {
  const std::size_t count = arguments.isovalues.size();
  const bool names_need_values = count > 1 || arguments.output.empty();
  const MeshFormat format = form_of(arguments).format;
  for (const IsovalueRequest& request : arguments.isovalues) {
    if (names_need_values && needs_histogram(request)) continue;
    if (!arguments.output.empty())
      check_can_write_mesh(named(arguments.output, request.number, count), format, arguments.force);
    else if (arguments.writes_mesh())
      check_can_write_mesh(default_output(arguments, format, request.number), format,
                           arguments.force);
  }
  if (!arguments.preview.path.empty() && count == 1)
    check_can_write(arguments.preview.path, arguments.force);
}

std::vector<ExtractedSurface> plan_surfaces(const ExtractArguments& arguments,
                                            const StoreReader& store, Console& console) {
  const std::vector<double> isovalues = isovalues_of(arguments, store, console);
  const bool chooses = arguments.max_triangles || !arguments.level;
  std::vector<ExtractedSurface> surfaces =
      chooses ? surfaces_of_fitting_level(arguments, store, isovalues, console)
              : surfaces_of_level(arguments, store, *arguments.level, isovalues);
  check_names(surfaces);
  return surfaces;
}

std::uint64_t memory_of_mesh(const ExtractedSurface& surface, std::size_t surfaces) {
  return surface.options.memory / surfaces;
}

ExtractEstimate estimate_one(const ExtractedSurface& surface, const StoreReader& store) {
  return estimate(store, surface.options,
                  surface.attribute_memory + memory_of_file(surface.form, surface.options.threads,
                                                            surface.options.memory));
}

void check_space(const std::vector<ExtractedSurface>& surfaces, const StoreReader& store,
                 std::uint64_t parts) {
  const auto part_of = [&](MeshSize mesh) {
    return MeshSize{mesh.vertices / parts, mesh.triangles / parts};
  };
  // Mostly all that the active cells could hold fits, which is known without a sample.
  std::vector<double> isovalues;
  for (const ExtractedSurface& surface : surfaces) isovalues.push_back(surface.options.isovalue);
  const std::vector<ActiveParts> active = count_active(store, surfaces.front().options, isovalues);
  const auto largest = planned_meshes(surfaces, [&](std::size_t i) {
    return PlannedMesh{.size = part_of(largest_mesh(active[i], surfaces[i].options.topology,
                                                    surfaces[i].options.cap))};
  });
  if (!find_shortage(largest, free_space)) return;
  const auto likely = planned_meshes(surfaces, [&](std::size_t i) {
    const ExtractEstimate guess = estimate_one(surfaces[i], store);
    return PlannedMesh{.size = part_of(guess.mesh), .uncertainty = guess.uncertainty};
  });
  if (const auto shortage = find_shortage(likely, free_space))
    throw Error(shortage_text(likely[shortage->mesh], *shortage,
                              is_standard_output(surfaces.front().output.native())));
}

bool need_pieces(const std::vector<ExtractedSurface>& surfaces, const StoreReader& store) {
  // Three edges from each sample, three vertices within its cell, and one on itself.
  constexpr std::uint64_t vertices_of_sample = 7;
  return std::any_of(surfaces.begin(), surfaces.end(), [&](const ExtractedSurface& surface) {
    const ExtractOptions& options = surface.options;
    PlannedMesh mesh{.form = surface.form, .filter = surface.filter};
    // Mostly the volume is too small, which is known without a range, or its active cells are too
    // few, which is known without a sample.
    const Lattice& lattice = store.info().levels[static_cast<std::size_t>(options.level)].lattice;
    mesh.size.vertices = vertices_of_sample * static_cast<std::uint64_t>(volume(lattice.extent));
    if (!needs_pieces(mesh, kMaxNarrowVertices)) return false;
    mesh.size = largest_mesh(count_active(store, options), options.topology, options.cap);
    if (!needs_pieces(mesh, kMaxNarrowVertices)) return false;
    const ExtractEstimate guess = estimate_one(surface, store);
    mesh.size = guess.mesh;
    mesh.uncertainty = guess.uncertainty;
    return needs_pieces(mesh, kMaxNarrowVertices);
  });
}

/// Refuses a budget in which pictures cannot be drawn, before anything is extracted.
void check_pictures(const std::vector<ExtractedSurface>& surfaces,
                    const ExtractArguments& arguments, const StoreReader& store) {
  for (const ExtractedSurface& surface : surfaces) {
    if (surface.preview.empty()) continue;
    const std::uint64_t least = min_with_picture(surface, surfaces.size(), arguments, store);
    if (arguments.memory < least)
      throw UsageError(fmt::format(
          "a memory budget of {:.1f} MiB is too small: with a picture of {} x {} pixels at least "
          "--memory {}M is needed, {:.1f} MiB of it for the picture and OpenGL's driver; or "
          "choose a smaller --size",
          in_mib(arguments.memory), arguments.preview.size.width, arguments.preview.size.height,
          mib_above(least), in_mib(preview_memory(arguments.preview) + preview_driver_memory())));
  }
}

}  // namespace isobrick::tools
