#include <fmt/format.h>

#include <array>
#include <memory>
#include <nlohmann/json.hpp>

#include "isobrick/io/png_file.h"
#include "isobrick/render/mesh_picture.h"
#include "tools/format.h"
#include "tools/options.h"

namespace isobrick::tools {
namespace {

struct Arguments {
  std::vector<std::string> meshes;
  std::vector<Vec3f> colours;
  std::vector<float> opacities;
  std::string output;
  MeshPictureRequest request;
  bool no_occlusion = false, force = false;
};

/// Told apart well, also by those who see red and green alike.
constexpr std::array<Vec3f, 6> kColours{{{0.87f, 0.80f, 0.70f},
                                         {0.80f, 0.36f, 0.28f},
                                         {0.33f, 0.55f, 0.80f},
                                         {0.90f, 0.70f, 0.27f},
                                         {0.36f, 0.66f, 0.57f},
                                         {0.66f, 0.45f, 0.66f}}};

MeshPictureRequest request_of(const Arguments& arguments) {
  MeshPictureRequest request = arguments.request;
  const std::size_t count = arguments.meshes.size();
  if (arguments.colours.size() > count || arguments.opacities.size() > count)
    throw UsageError("there are more colours or opacities than meshes");
  for (std::size_t i = 0; i < count; ++i) {
    MeshStyle style{.colour = kColours[i % kColours.size()]};
    if (i < arguments.colours.size()) style.colour = arguments.colours[i];
    if (i < arguments.opacities.size()) style.opacity = arguments.opacities[i];
    request.meshes.push_back({arguments.meshes[i], style});
  }
  request.settings.occlusion = !arguments.no_occlusion;
  return request;
}

int run(const Arguments& arguments, Console& console) {
  const MeshPictureRequest request = request_of(arguments);
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

/// "X0:X1,Y0:Y1,Z0:Z1".
WorldBox parse_box(const std::string& text) {
  std::array<double, 6> v{};
  std::size_t at = 0;
  for (std::size_t i = 0; i < 6; ++i) {
    const std::size_t end = i == 5 ? text.size() : text.find(i % 2 ? ',' : ':', at);
    if (end == text.npos)
      throw UsageError(fmt::format("'{}' is not of the form X0:X1,Y0:Y1,Z0:Z1", text));
    v[i] = parse_number(text.substr(at, end - at));
    at = end + 1;
  }
  for (std::size_t i = 0; i < 6; i += 2)
    if (!(v[i] < v[i + 1])) throw UsageError(fmt::format("the box '{}' is empty", text));
  return {{v[0], v[2], v[4]}, {v[1], v[3], v[5]}};
}

void add_cut_options(CLI::App* app, PictureSettings& settings) {
  add_clip(app, settings.planes);
  add_parsed(app, settings.region,
             [](const std::string& text) { return std::optional(parse_box(text)); },
             {"--region", "X0:X1,Y0:Y1,Z0:Z1", "Draw only what is in this box, world units"});
}

void add_overlay_options(CLI::App* app, MeshPictureRequest& request) {
  add_flag(app, "--box", request.box, "Draw the box around all meshes");
  add_flag(app, "--axes", request.axes, "Draw the directions of x, y and z");
  add_text(app, {"--scale-bar", "UNIT", "Draw a bar of a round length in this unit, such as mm"},
           [&request](const std::string& text) {
             request.scale_bar = true;
             request.unit = text;
           });
}

}  // namespace

void add_render(Program& program) {
  auto arguments = std::make_shared<Arguments>();
  MeshPictureRequest& request = arguments->request;
  CLI::App* app = add_subcommand(program, "render", "Draw mesh files of any size into a picture.",
                                 "isobrick render skin.ply bone.ply --opacity 0.3 --camera "
                                 "azimuth=40,elevation=15 -o head.png");
  add_paths(app, "MESH", arguments->meshes, "Meshes to draw: PLY, STL, GLB or OBJ");
  add_text(app, {"-o,--output", "PNG", "Picture to write", "", true},
           [&output = arguments->output](const std::string& text) { output = text; });
  add_text(app, {"--size", "WxH", "Size of the picture, pixels", "1280x960"},
           [&request](const std::string& text) {
             const PictureSize size = parse_picture_size(text);
             request.width = size.width;
             request.height = size.height;
           });
  add_parsed(app, request.camera, parse_camera,
             {"--camera", "PARTS",
              "azimuth=DEG,elevation=DEG,roll=DEG,zoom=X,fov=DEG,orthographic,up=X:Y:Z,from=X:Y:Z, "
              "or eye=X:Y:Z,target=X:Y:Z",
              "azimuth=30,elevation=20"});
  add_repeated(app, {"--colour", "#RRGGBB", "Of the first mesh, the second and so on"},
               [&colours = arguments->colours](const std::string& text) {
                 colours.push_back(parse_colour(text));
               });
  add_repeated(app, {"--opacity", "A", "Of the first mesh, the second and so on", "1"},
               [&opacities = arguments->opacities](const std::string& text) {
                 opacities.push_back(parse_opacity(text));
               });
  add_flag(app, "--edges", request.settings.edges, "Dark lines where the surface breaks off");
  add_flag(app, "--no-occlusion", arguments->no_occlusion, "Do not darken hollows");
  add_text(
      app,
      {"--background", "COLOUR[,BOTTOM]", "Behind the meshes, from top to bottom", "a light grey"},
      [&request](const std::string& text) { parse_background(text, request.settings); });
  add_cut_options(app, request.settings);
  add_overlay_options(app, request);
  add_force(app, arguments->force);
  add_run(program, app, arguments, run);
}

}  // namespace isobrick::tools
