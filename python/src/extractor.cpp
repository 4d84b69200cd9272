#include <isobrick/volume_extractor.h>

#include <pybind11/numpy.h>

#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include <isobrick/error.h>
#include <isobrick/mesh_file_sink.h>
#include <isobrick/mesh_filters.h>
#include <isobrick/mesh_sinks.h>
#include "python/src/bindings.h"
#include "python/src/cancellable_sink.h"
#include "python/src/casters.h"
#include "python/src/filtered.h"
#include "python/src/interruptible.h"
#include "python/src/isovalues.h"
#include "python/src/labels.h"
#include "python/src/sample_array.h"
#include "python/src/surface_bounds.h"

namespace isobrick::python {
namespace {

/// Surfaces of an array, which it keeps alive.
class ArrayExtractor {
 public:
  ArrayExtractor(const Volume& volume, py::object samples, py::object mask)
      : samples_(std::move(samples)), mask_(std::move(mask)), volume_(volume), extractor_(volume) {}

  std::unique_ptr<Mesh> extract(ExtractOptions options, const MeshFilterOptions& filters,
                                const py::object& callback) {
    auto mesh = std::make_unique<Mesh>();
    run_interruptibly(callback, [&](Reporter reporter) {
      const std::lock_guard lock(mutex_);
      options.cancel = reporter.cancel;
      if (!filters.any()) {
        extractor_.extract(options, *mesh, reporter.progress);
        return;
      }
      MemorySink sink(*mesh);
      MeshFilter filter(sink, within_budget(filters, options.memory, 1, "-", reporter));
      extractor_.extract(options, filter, reporter.progress);
    });
    return mesh;
  }

  void extract_to(ExtractOptions options, MeshSink& sink, const py::object& callback) {
    run_interruptibly(callback, [&](Reporter reporter) {
      const std::lock_guard lock(mutex_);
      options.cancel = reporter.cancel;
      CancellableSink cancellable(sink, reporter.cancel);
      extractor_.extract(options, cancellable, reporter.progress);
    });
  }

  py::dict extract_labels(const LabelOptions& options, const py::object& callback) {
    return label_meshes(callback, [&](const LabelVisitor& visit, const Reporter& reporter) {
      const std::lock_guard lock(mutex_);
      LabelOptions cancellable = options;
      cancellable.cancel = reporter.cancel;
      isobrick::extract_labels(volume_, cancellable, visit, reporter.progress);
    });
  }

  std::pair<Vec3d, Vec3d> bounds(ExtractOptions options) {
    return interruptible(py::none(), [&](Reporter reporter) {
      const std::lock_guard lock(mutex_);
      options.cancel = reporter.cancel;
      return surface_bounds([&](MeshSink& sink) { extractor_.extract(options, sink); });
    });
  }

  py::dict save(ExtractOptions options, const MeshFilterOptions& filters, const std::string& path,
                const MeshFileOptions& file, const py::object& callback) {
    std::unique_ptr<MeshSink> sink;
    std::unique_ptr<MeshFilter> filter;
    run_interruptibly(callback, [&](Reporter reporter) {
      const std::lock_guard lock(mutex_);
      options.cancel = reporter.cancel;
      sink = create_mesh_file(path, file);
      filter = std::make_unique<MeshFilter>(
          *sink, within_budget(filters, options.memory, 1, path, reporter));
      extractor_.extract(options, *filter, reporter.progress);
    });
    py::dict report;
    add_filtered(report, *filter);
    return report;
  }

  std::vector<double> isovalues(const std::string& text, int threads, const py::object& callback) {
    return interruptible(callback, [&](Reporter reporter) {
      const std::lock_guard lock(mutex_);
      return resolve_isovalues(parse_isovalues(text), volume_.type,
                               [&] { return counted(threads, reporter.progress); });
    });
  }

  Suggestion suggested_isovalue(int threads, const py::object& callback) {
    return pair_of(interruptible(callback, [&](Reporter reporter) {
      const std::lock_guard lock(mutex_);
      return suggest_isovalue(volume_.type, counted(threads, reporter.progress));
    }));
  }

  py::dict histogram(int bins, int threads, const py::object& callback) {
    return describe(interruptible(callback, [&](Reporter reporter) {
      const std::lock_guard lock(mutex_);
      return rebin(counted(threads, reporter.progress), bins);
    }));
  }

  std::optional<std::pair<double, double>> range() {
    const py::gil_scoped_release release;
    const std::lock_guard lock(mutex_);
    const auto range = extractor_.range();
    if (!range || range->empty()) return std::nullopt;
    return std::pair(range->lo, range->hi);
  }

 private:
  const Histogram& counted(int threads, Progress& progress) {
    if (!histogram_) histogram_ = extractor_.histogram(threads, progress);
    return *histogram_;
  }

  py::object samples_, mask_;
  Volume volume_;
  std::mutex mutex_;  ///< one operation at a time
  VolumeExtractor extractor_;
  std::optional<Histogram> histogram_;  ///< of all samples, once they were counted
};

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
      .def("extract_to", &ArrayExtractor::extract_to)
      .def("extract_labels", &ArrayExtractor::extract_labels)
      .def("surface_bounds", &ArrayExtractor::bounds)
      .def("save", &ArrayExtractor::save)
      .def("isovalues", &ArrayExtractor::isovalues)
      .def("suggested_isovalue", &ArrayExtractor::suggested_isovalue)
      .def("histogram", &ArrayExtractor::histogram)
      .def_property_readonly("range", &ArrayExtractor::range);
}

}  // namespace isobrick::python
