#include <array>
#include <optional>
#include <string>

#include <isobrick/extract.h>
#include <isobrick/labels.h>
#include <isobrick/mesh_file_sink.h>
#include <isobrick/mesh_filters.h>
#include <isobrick/transform.h>
#include <isobrick/volume_request.h>
#include "core/length_unit.h"
#include "python/src/bindings.h"
#include "python/src/casters.h"

namespace isobrick::python {
namespace {

namespace py = pybind11;

void bind_transform(py::module_& module) {
  py::class_<Transform>(module, "Transform")
      .def(py::init<>())
      .def_readwrite("spacing", &Transform::spacing)
      .def_readwrite("origin", &Transform::origin)
      .def_readwrite("direction", &Transform::direction)
      .def_readwrite("unit", &Transform::unit);
  module.def("unit_name", [](const std::string& unit) { return unit_name(unit); });
  module.def("unit_names", &unit_names);
  module.def("unit_ratio", [](const std::string& unit, const std::string& other) {
    return unit_ratio(unit, other).value_or(1);
  });
}

void bind_extract_options(py::module_& module) {
  py::enum_<Inside>(module, "Inside").value("above", Inside::above).value("below", Inside::below);
  py::enum_<Topology>(module, "Topology")
      .value("consistent", Topology::consistent)
      .value("trilinear", Topology::trilinear);
  py::enum_<Backend>(module, "Backend")
      .value("auto", Backend::automatic)
      .value("cpu", Backend::cpu)
      .value("cuda", Backend::cuda);
  py::class_<ExtractOptions>(module, "ExtractOptions")
      .def(py::init<>())
      .def_readwrite("isovalue", &ExtractOptions::isovalue)
      .def_readwrite("level", &ExtractOptions::level)
      .def_readwrite("roi", &ExtractOptions::roi)
      .def_readwrite("inside", &ExtractOptions::inside)
      .def_readwrite("normals", &ExtractOptions::normals)
      .def_readwrite("drop_degenerate", &ExtractOptions::drop_degenerate)
      .def_readwrite("topology", &ExtractOptions::topology)
      .def_readwrite("cap", &ExtractOptions::cap)
      .def_readwrite("memory", &ExtractOptions::memory)
      .def_readwrite("memory_of_others", &ExtractOptions::memory_of_others)
      .def_readwrite("threads", &ExtractOptions::threads)
      .def_readwrite("backend", &ExtractOptions::backend)
      .def_readwrite("gpu_memory", &ExtractOptions::gpu_memory)
      .def_readwrite("device", &ExtractOptions::device);
}

void bind_label_options(py::module_& module) {
  py::class_<LabelOptions>(module, "LabelOptions")
      .def(py::init<>())
      .def("add_labels",
           [](LabelOptions& o, const Label& first, const Label& last) {
             o.labels.push_back({first, last});
           })
      .def_readwrite("background", &LabelOptions::background)
      .def_readwrite("level", &LabelOptions::level)
      .def_readwrite("roi", &LabelOptions::roi)
      .def_readwrite("smooth", &LabelOptions::smooth)
      .def_readwrite("pass_band", &LabelOptions::pass_band)
      .def_readwrite("memory", &LabelOptions::memory)
      .def_readwrite("threads", &LabelOptions::threads);
}

void bind_mesh_filter_options(py::module_& module) {
  py::class_<MeshFilterOptions>(module, "MeshFilterOptions")
      .def(py::init<>())
      .def_readwrite("min_component", &MeshFilterOptions::min_component)
      .def_readwrite("largest", &MeshFilterOptions::largest)
      .def_readwrite("smooth", &MeshFilterOptions::smooth)
      .def_readwrite("pass_band", &MeshFilterOptions::pass_band)
      .def_readwrite("simplify_ratio", &MeshFilterOptions::simplify_ratio)
      .def_readwrite("simplify_triangles", &MeshFilterOptions::simplify_triangles)
      .def_readwrite("max_error", &MeshFilterOptions::max_error)
      .def_readwrite("threads", &MeshFilterOptions::threads)
      .def_readwrite("unit", &MeshFilterOptions::unit)
      .def_readwrite("measure", &MeshFilterOptions::measure)
      .def("any", &MeshFilterOptions::any);
}

void bind_mesh_file_options(py::module_& module) {
  py::class_<MeshFileOptions>(module, "MeshFileOptions")
      .def(py::init<>())
      .def_readwrite("quantize", &MeshFileOptions::quantize)
      .def_readwrite("compress", &MeshFileOptions::compress)
      .def_readwrite("levels", &MeshFileOptions::levels)
      .def_readwrite("sharded", &MeshFileOptions::sharded)
      .def_readwrite("force", &MeshFileOptions::force)
      .def_readwrite("threads", &MeshFileOptions::threads)
      .def_readwrite("memory", &MeshFileOptions::memory);
}

void bind_volume_request(py::module_& module) {
  py::class_<VolumeRequest>(module, "VolumeRequest")
      .def(py::init<>())
      .def_readwrite("extent", &VolumeRequest::extent)
      .def_readwrite("type", &VolumeRequest::type)
      .def_property(
          "big_endian", [](const VolumeRequest& r) { return r.order == ByteOrder::big; },
          [](VolumeRequest& r, bool big) { r.order = big ? ByteOrder::big : ByteOrder::little; })
      .def_readwrite("offset", &VolumeRequest::offset)
      .def_readwrite("spacing", &VolumeRequest::spacing)
      .def_readwrite("origin", &VolumeRequest::origin)
      .def_readwrite("unit", &VolumeRequest::unit)
      .def_readwrite("grid", &VolumeRequest::grid)
      .def_readwrite("stride", &VolumeRequest::stride)
      .def_readwrite("nodata", &VolumeRequest::nodata)
      .def_readwrite("memory", &VolumeRequest::memory)
      .def_readwrite("threads", &VolumeRequest::threads)
      .def_property(
          "channel", [](const VolumeRequest& r) { return r.selection.channel; },
          [](VolumeRequest& r, std::optional<Index> channel) { r.selection.channel = channel; })
      .def_property(
          "time", [](const VolumeRequest& r) { return r.selection.time; },
          [](VolumeRequest& r, std::optional<Index> time) { r.selection.time = time; })
      .def("set_roi", [](VolumeRequest& r, const std::array<std::optional<Index>, 3>& lo,
                         const std::array<std::optional<Index>, 3>& hi) {
        r.roi = RegionRequest{{lo[2], lo[1], lo[0]}, {hi[2], hi[1], hi[0]}};
      });
}

}  // namespace

void bind_options(py::module_& module) {
  bind_transform(module);
  bind_extract_options(module);
  bind_label_options(module);
  bind_mesh_filter_options(module);
  bind_mesh_file_options(module);
  bind_volume_request(module);
}

}  // namespace isobrick::python
