#include <CLI/CLI.hpp>

#include "isobrick/core/error.h"
#include "tools/options.h"
#include "tools/pictures.h"

namespace isobrick::tools {
namespace {

[[noreturn]] void refuse(const std::string& what) {
  throw UsageError(what +
                   " needs OpenGL, which this program was built without; build it where libepoxy, "
                   "GLM, stb and the font DejaVu Sans are installed (ISOBRICK_VIEWER)");
}

struct Arguments {};

int run(const Arguments&, Console&) { refuse("'isobrick render'"); }

}  // namespace

std::unique_ptr<MeshSink> open_preview(const std::string&, bool, const PreviewOptions&) {
  refuse("--preview");
}

std::uint64_t preview_memory(const PreviewOptions&) { refuse("--preview"); }

void add_render(Program& program) {
  CLI::App* app = add_subcommand(program, "render", "Draw mesh files (not in this program).",
                                 "isobrick render bone.ply -o bone.png");
  app->allow_extras();
  add_run(program, app, std::make_shared<Arguments>(), run);
}

}  // namespace isobrick::tools
