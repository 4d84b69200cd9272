#include "tools/picture_options.h"

#include <fmt/format.h>

#include "tools/pictures.h"
#include "viewer/render/surface_colour.h"

namespace isobrick::tools {

void add_picture_options(CLI::App* app, PictureOptions& options, const std::string& thing) {
  add_picture_size(app, options.size);
  add_camera(app, options.camera);
  const std::string each = fmt::format("Of the first {}, the second and so on", thing);
  add_repeated(app, {"--colour", "#RRGGBB", each}, [&options](const std::string& text) {
    options.colours.push_back(parse_colour(text));
  });
  add_repeated(app, {"--opacity", "A", each, "1"}, [&options](const std::string& text) {
    options.opacities.push_back(parse_opacity(text));
  });
  add_clip(app, options.planes);
  add_flag(app, "--edges", options.edges, "Dark lines where the surface breaks off");
  add_flag(app, "--no-occlusion", options.no_occlusion, "Do not darken hollows");
}

std::vector<MeshStyle> styles_of(const PictureOptions& options, std::size_t count,
                                 const std::string& things) {
  if (options.colours.size() > count || options.opacities.size() > count)
    throw UsageError(fmt::format("there are more colours or opacities than {}", things));
  std::vector<MeshStyle> styles;
  for (std::size_t i = 0; i < count; ++i) {
    MeshStyle style{.colour = surface_colour(i)};
    if (i < options.colours.size()) {
      style.colour = options.colours[i];
      style.vertex_colours = false;
    }
    if (i < options.opacities.size()) style.opacity = options.opacities[i];
    styles.push_back(style);
  }
  return styles;
}

}  // namespace isobrick::tools
