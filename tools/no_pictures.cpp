#include <CLI/CLI.hpp>

#include <isobrick/error.h>
#include "tools/options.h"
#include "tools/pictures.h"

namespace isobrick::tools {
namespace {

[[noreturn]] void refuse(const std::string& what) {
  throw UsageError(
      what +
      " needs OpenGL, which this program was built without; build it where libepoxy, "
      "GLM, GLFW, Dear ImGui, stb and the font DejaVu Sans are installed (ISOBRICK_VIEWER)");
}

struct Arguments {};

int run(const Arguments&, Console&) { refuse("this subcommand"); }

void add_refused(Program& program, const std::string& name, const std::string& description,
                 const std::string& example) {
  CLI::App* app = add_subcommand(program, name, description + " (not in this program).", example);
  app->allow_extras();
  add_run(program, app, std::make_shared<Arguments>(), run);
}

}  // namespace

void add_picture_size(CLI::App* app, PictureSize& size) {
  add_parsed(app, size, parse_picture_size,
             {"--size", "WxH", "Pixels of the picture (not in this program)", "1280x960"});
}

void add_camera(CLI::App* app, CameraRequest&) {
  add_text(app, {"--camera", "PARTS", "How to look at it (not in this program)"},
           [](const std::string&) {});
}

std::unique_ptr<MeshSink> open_preview(const std::string&, bool, const PreviewRequest&) {
  refuse("--preview");
}

std::uint64_t preview_memory(const PreviewRequest&) { refuse("--preview"); }
std::uint64_t preview_driver_memory() { refuse("--preview"); }

void add_render(Program& program) {
  add_refused(program, "render", "Draw mesh files", "isobrick render head_500.ply -o head.png");
}

void add_view(Program& program) {
  add_refused(program, "view", "Look at a store", "isobrick view head.zarr");
}

}  // namespace isobrick::tools
