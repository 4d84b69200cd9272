#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include <isobrick/error.h>
#include "core/length_unit.h"
#include "io/bytes/output_guard.h"
#include "io/bytes/parted_output.h"
#include "io/bytes/png_file.h"
#include "io/meshes/mesh_name.h"
#include "pipeline/program_memory.h"
#include "tools/format.h"
#include "tools/output_name.h"
#include "tools/picture_options.h"
#include "viewer/render/mesh_picture.h"

namespace isobrick::tools {
namespace {

struct RenderArguments {
  std::vector<std::string> meshes;
  std::string output;
  PictureOptions picture{.size = {1280, 960}};
  MeshPictureRequest request;
  std::optional<WorldRegion> region;
  std::uint64_t memory = 0;
  bool force = false;
};

MeshPictureRequest request_of(const RenderArguments& arguments) {
  const PictureOptions& picture = arguments.picture;
  MeshPictureRequest request = arguments.request;
  const std::vector<MeshStyle> styles = styles_of(picture, arguments.meshes.size(), "meshes");
  for (std::size_t i = 0; i < styles.size(); ++i)
    request.meshes.push_back({arguments.meshes[i], styles[i]});
  request.width = picture.size.width;
  request.height = picture.size.height;
  request.camera = picture.camera;
  request.settings.planes = picture.planes;
  if (arguments.region)
    request.settings.region = WorldBox{arguments.region->lo, arguments.region->hi};
  request.settings.edges = picture.edges;
  request.settings.occlusion = !picture.no_occlusion;
  return request;
}

/// The meshes with the folders of their parts.
std::vector<std::filesystem::path> input_paths(const std::vector<std::string>& meshes) {
  std::vector<std::filesystem::path> paths(meshes.begin(), meshes.end());
  for (const std::string& mesh : meshes)
    for (std::filesystem::path& folder : part_folders(mesh)) paths.push_back(std::move(folder));
  return paths;
}

void check_memory(const MeshPictureRequest& request, std::uint64_t memory) {
  const std::uint64_t picture = mesh_picture_memory(request), least = kProgramBytes + picture;
  if (memory < least)
    throw UsageError(fmt::format(
        "a memory budget of {:.1f} MiB is too small: a picture of {} x {} pixels needs --memory "
        "{}M at least, {} MiB of it for the program and its libraries, {} for OpenGL's driver; or "
        "choose a smaller --size",
        in_mib(memory), request.width, request.height, mib_above(least), kProgramBytes >> 20,
        Renderer::driver_memory() >> 20));
}

int run_render(const RenderArguments& given, Console& console) {
  RenderArguments arguments = given;
  if (arguments.output.empty()) arguments.output = stem_of_input(arguments.meshes.front()) + ".png";
  if (is_standard_output(arguments.output)) console.reserve_output();
  check_picture_name(arguments.output);
  const MeshPictureRequest request = request_of(arguments);
  check_memory(request, arguments.memory);
  check_replaces_no_input(arguments.output, input_paths(arguments.meshes));
  OutputFile out(arguments.output, arguments.force);
  MeshPicture picture = draw_mesh_files(request, console.progress());
  write_png(out, request.width, request.height, without_alpha(std::move(picture.rgba)));
  console.result({{"command", "render"},
                  {"meshes", arguments.meshes},
                  {"output", arguments.output},
                  {"width", request.width},
                  {"height", request.height},
                  {"vertices", picture.vertices},
                  {"triangles", picture.triangles},
                  {"bounds", {to_json(picture.lo), to_json(picture.hi)}},
                  {"unit", picture.unit},
                  {"renderer", picture.renderer},
                  {"peak_resident_bytes", peak_resident_bytes()}},
                 fmt::format("{}: {} triangles, drawn by {}\n", arguments.output,
                             human_count(picture.triangles), picture.renderer));
  return 0;
}

/// "COLOUR" or "TOP,BOTTOM".
void parse_background(const std::string& text, PictureSettings& settings) {
  const auto comma = text.find(',');
  settings.background_top = parse_colour(text.substr(0, comma));
  settings.background_bottom =
      comma == text.npos ? settings.background_top : parse_colour(text.substr(comma + 1));
}

/// A unit of length, or the meshes' own.
std::string parse_bar_unit(const std::string& text) {
  if (text == "auto") return {};
  std::string unit = unit_name(text);
  if (unit.empty())
    throw UsageError(
        fmt::format("'{}' is no unit of length; it is one of {}, or a symbol such "
                    "as mm",
                    text, unit_names()));
  return unit;
}

void add_overlay_options(CLI::App* app, MeshPictureRequest& request) {
  add_flag(app, "--box", request.box, "Draw the box around all meshes");
  add_flag(app, "--axes", request.axes, "Draw the directions of x, y and z");
  add_text(app,
           {.name = "--scale-bar",
            .value = "auto|m|cm|mm|um|nm|UNIT",
            .help = "Draw a bar of a round length in this unit; auto: that of the meshes",
            .may_be_bare = true},
           [&request](const std::string& text) {
             request.scale_bar = true;
             request.scale_bar_unit = parse_bar_unit(text);
           });
}

}  // namespace

void add_render(Program& program) {
  auto arguments = std::make_shared<RenderArguments>();
  MeshPictureRequest& request = arguments->request;
  CLI::App* app =
      add_subcommand(program, "render", "Draw mesh files of any size into a picture.",
                     "isobrick render head_500.ply head_1150.ply --opacity 0.3 --camera "
                     "azimuth=40,elevation=15 -o head.png");
  add_paths(app, "MESH", arguments->meshes, "Meshes to draw: " + mesh_extensions());
  add_output(app, arguments->output, "PNG", "Picture to write, - for standard output",
             "head_500.png of head_500.ply, in the current folder");
  add_picture_options(app, arguments->picture, "mesh");
  add_text(
      app,
      {"--background", "COLOUR[,BOTTOM]", "Behind the meshes, from top to bottom", "a light grey"},
      [&request](const std::string& text) { parse_background(text, request.settings); });
  add_world_region(app, arguments->region);
  add_overlay_options(app, request);
  add_memory(app, arguments->memory);
  add_force(app, arguments->force);
  add_run(program, app, arguments, run_render);
}

}  // namespace isobrick::tools
