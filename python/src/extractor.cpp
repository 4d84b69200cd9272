#include <isobrick/volume_extractor.h>

#include <pybind11/numpy.h>

#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include <isobrick/error.h>
#include <isobrick/mesh_file_sink.h>
#include "python/src/bindings.h"
#include "python/src/casters.h"
#include "python/src/interruptible.h"
#include "python/src/sample_array.h"

namespace isobrick::python {
namespace {

/// Surfaces of an array, which it keeps alive.
class ArrayExtractor {
 public:
  ArrayExtractor(const Volume& volume, py::object samples, py::object mask)
      : samples_(std::move(samples)), mask_(std::move(mask)), extractor_(volume) {}

  std::unique_ptr<Mesh> extract(ExtractOptions options, const py::object& callback) {
    auto mesh = std::make_unique<Mesh>();
    run_interruptibly(callback, [&](Reporter reporter) {
      const std::lock_guard lock(mutex_);
      options.cancel = reporter.cancel;
      extractor_.extract(options, *mesh, reporter.progress);
    });
    return mesh;
  }

  py::dict save(ExtractOptions options, const std::string& path, const MeshFileOptions& file,
                const py::object& callback) {
    const SurfaceReport report = interruptible(callback, [&](Reporter reporter) {
      const std::lock_guard lock(mutex_);
      options.cancel = reporter.cancel;
      const auto sink = create_mesh_file(path, file);
      return extractor_.extract(options, *sink, reporter.progress);
    });
    return py::dict(py::arg("vertices") = report.vertices, py::arg("faces") = report.triangles);
  }

  std::optional<std::pair<double, double>> range() {
    const py::gil_scoped_release release;
    const std::lock_guard lock(mutex_);
    const auto range = extractor_.range();
    if (!range || range->empty()) return std::nullopt;
    return std::pair(range->lo, range->hi);
  }

 private:
  py::object samples_, mask_;
  std::mutex mutex_;  ///< one operation at a time
  VolumeExtractor extractor_;
};

void add_missing(Volume& volume, std::optional<double> nodata, const py::object& mask) {
  volume.nodata = nodata;
  if (mask.is_none()) return;
  const auto array = py::cast<py::array>(mask);
  if (array.itemsize() != 1) throw UsageError("a mask has one byte a sample");
  const Volume flags = volume_of(array, ScalarType::u8);
  if (!(flags.extent == volume.extent))
    throw UsageError("the mask must have the shape of the array");
  volume.mask = static_cast<const std::uint8_t*>(flags.samples);
  volume.mask_strides = flags.strides;
}

std::unique_ptr<ArrayExtractor> of_array(const py::array& samples, const Transform& transform,
                                         std::optional<double> nodata, const py::object& mask) {
  Volume volume = volume_of(samples);
  volume.transform = transform;
  add_missing(volume, nodata, mask);
  return std::make_unique<ArrayExtractor>(volume, samples, mask);
}

std::unique_ptr<ArrayExtractor> of_function(const py::object& read, Int3 extent, ScalarType type,
                                            const Transform& transform,
                                            std::optional<double> nodata, const py::object& mask) {
  Volume volume = volume_of(read, extent, type);
  volume.transform = transform;
  add_missing(volume, nodata, mask);
  return std::make_unique<ArrayExtractor>(volume, read, mask);
}

}  // namespace

void bind_extractor(py::module_& module) {
  py::class_<ArrayExtractor>(module, "ArrayExtractor")
      .def_static("of_array", &of_array)
      .def_static("of_function", &of_function)
      .def("extract", &ArrayExtractor::extract)
      .def("save", &ArrayExtractor::save)
      .def_property_readonly("range", &ArrayExtractor::range);
}

}  // namespace isobrick::python
