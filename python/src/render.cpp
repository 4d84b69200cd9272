#include <pybind11/numpy.h>

#include <array>
#include <cstring>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "core/length_unit.h"
#include "io/bytes/png_file.h"
#include "python/src/bindings.h"
#include "python/src/casters.h"
#include "python/src/interruptible.h"
#include "viewer/render/mesh_picture.h"
#include "viewer/render/picture_sink.h"
#include "viewer/render/surface_colour.h"

// The module of pictures, which needs OpenGL. It shares MeshSink with the module of everything
// else, whose surfaces it draws.

namespace isobrick::python {
namespace {

using Colour = std::array<float, 3>;

Vec3f colour_of(const Colour& c) { return {c[0], c[1], c[2]}; }

MeshStyle style_of(std::size_t number, const std::optional<Colour>& colour, float opacity) {
  MeshStyle style{.colour = surface_colour(number), .opacity = opacity};
  if (colour) {
    style.colour = colour_of(*colour);
    style.vertex_colours = false;
  }
  return style;
}

void set_planes(PictureSinkOptions& options, const std::vector<std::array<double, 4>>& planes) {
  if (planes.size() > kMaxClipPlanes)
    throw UsageError(fmt::format("{} clip planes at most, not {}", kMaxClipPlanes, planes.size()));
  options.settings.planes.clear();
  for (const auto& [x, y, z, least] : planes) {
    if (Vec3d{x, y, z} == Vec3d{}) throw UsageError("a clip plane has no direction");
    options.settings.planes.push_back({{x, y, z}, least});
  }
}

void bind_options_of_pictures(py::module_& module) {
  using Options = PictureSinkOptions;
  py::class_<Options>(module, "PictureOptions")
      .def(py::init<>())
      .def_readwrite("width", &Options::width)
      .def_readwrite("height", &Options::height)
      .def("set_camera", [](Options& o, const std::string& text) { o.camera = parse_camera(text); })
      .def("set_background",
           [](Options& o, const Colour& top, const Colour& bottom) {
             o.settings.background_top = colour_of(top);
             o.settings.background_bottom = colour_of(bottom);
           })
      .def("set_planes", &set_planes)
      .def("set_region",
           [](Options& o, Vec3d lo, Vec3d hi) {
             o.settings.region = WorldBox{lo, hi};
           })
      .def("set_frame",
           [](Options& o, Vec3d lo, Vec3d hi) {
             o.frame = MeshBounds{lo, hi};
           })
      .def_property(
          "edges", [](const Options& o) { return o.settings.edges; },
          [](Options& o, bool edges) { o.settings.edges = edges; })
      .def_property(
          "occlusion", [](const Options& o) { return o.settings.occlusion; },
          [](Options& o, bool occlusion) { o.settings.occlusion = occlusion; })
      .def_readwrite("box", &Options::box)
      .def_readwrite("axes", &Options::axes)
      .def_readwrite("scale_bar", &Options::scale_bar)
      .def_readwrite("scale_bar_unit", &Options::scale_bar_unit);
}

/// An array [row, column, RGB] of RGBA pixels.
py::array_t<std::uint8_t> picture_array(std::vector<std::uint8_t> rgba, int width, int height) {
  const std::vector<std::uint8_t> rgb = without_alpha(std::move(rgba));
  py::array_t<std::uint8_t> array({height, width, 3});
  std::memcpy(array.mutable_data(), rgb.data(), rgb.size());
  return array;
}

/// Takes meshes and becomes a picture.
class Drawing {
 public:
  explicit Drawing(const PictureSinkOptions& options) : options_(options), sink_(options) {}

  PictureSink& sink() { return sink_; }
  void set_style(std::size_t number, const std::optional<Colour>& colour, float opacity) {
    sink_.set_style(style_of(number, colour, opacity));
  }
  py::array_t<std::uint8_t> end() {
    return picture_array(
        interruptible(py::none(), [&](Reporter reporter) { return sink_.end(reporter.cancel); }),
        options_.width, options_.height);
  }

 private:
  PictureSinkOptions options_;
  PictureSink sink_;
};

using FileStyle = std::tuple<std::string, std::optional<Colour>, float>;

py::tuple draw_files(const std::vector<FileStyle>& files, const PictureSinkOptions& options,
                     const py::object& callback) {
  MeshPictureRequest request{.width = options.width,
                             .height = options.height,
                             .camera = options.camera,
                             .settings = options.settings,
                             .box = options.box,
                             .axes = options.axes,
                             .scale_bar = options.scale_bar,
                             .scale_bar_unit = options.scale_bar_unit};
  for (const auto& [path, colour, opacity] : files)
    request.meshes.push_back({path, style_of(request.meshes.size(), colour, opacity)});
  MeshPicture picture = interruptible(
      callback, [&](Reporter reporter) { return draw_mesh_files(request, reporter.progress); });
  return py::make_tuple(picture_array(std::move(picture.rgba), options.width, options.height),
                        picture.renderer);
}

using Pixels = py::array_t<std::uint8_t, py::array::c_style>;

std::span<const std::uint8_t> bytes_of(const Pixels& pixels) {
  if (pixels.ndim() != 3 || pixels.shape(2) != 3)
    throw UsageError("a picture has rows of pixels of three bytes");
  return {pixels.data(), static_cast<std::size_t>(pixels.size())};
}

py::bytes encode(const Pixels& pixels) {
  const auto rgb = bytes_of(pixels);
  const std::vector<std::byte> png = interruptible(py::none(), [&](Reporter) {
    return encode_png("picture", static_cast<int>(pixels.shape(1)),
                      static_cast<int>(pixels.shape(0)), rgb);
  });
  return {reinterpret_cast<const char*>(png.data()), png.size()};
}

void save(const Pixels& pixels, const std::string& path, bool force) {
  const auto rgb = bytes_of(pixels);
  run_interruptibly(py::none(), [&](Reporter) {
    write_png(path, static_cast<int>(pixels.shape(1)), static_cast<int>(pixels.shape(0)), rgb,
              force);
  });
}

}  // namespace
}  // namespace isobrick::python

PYBIND11_MODULE(_render, module) {
  using namespace isobrick::python;
  module.doc() = "Pictures by OpenGL; use the package isobrick.";
  py::module_::import("isobrick._isobrick");  // MeshSink
  bind_errors();
  bind_options_of_pictures(module);
  py::class_<isobrick::PictureSink, isobrick::MeshSink>(module, "PictureSink");
  py::class_<Drawing>(module, "Drawing")
      .def(py::init<const isobrick::PictureSinkOptions&>(),
           py::call_guard<py::gil_scoped_release>())
      .def_property_readonly("sink", &Drawing::sink, py::return_value_policy::reference_internal)
      .def_property_readonly("renderer",
                             [](Drawing& drawing) { return drawing.sink().renderer_name(); })
      .def("set_style", &Drawing::set_style)
      .def("end", &Drawing::end);
  module.def("draw_files", &draw_files);
  module.def("encode_png", &encode);
  module.def("save_png", &save);
}
