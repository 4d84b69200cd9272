#include <isobrick/open_volume.h>

#include <pybind11/numpy.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include <isobrick/attributes.h>
#include <isobrick/error.h>
#include <isobrick/estimate.h>
#include <isobrick/export.h>
#include <isobrick/extract.h>
#include <isobrick/mesh_file_sink.h>
#include <isobrick/mesh_filters.h>
#include <isobrick/mesh_sinks.h>
#include "pipeline/slab_reader.h"
#include "pipeline/workers.h"
#include "python/src/bindings.h"
#include "python/src/cancellable_sink.h"
#include "python/src/casters.h"
#include "python/src/colours.h"
#include "python/src/descriptions.h"
#include "python/src/filtered.h"
#include "python/src/interruptible.h"
#include "python/src/isovalues.h"
#include "python/src/labels.h"
#include "python/src/surface_bounds.h"

namespace isobrick::python {
namespace {

const LevelInfo& level_of(const StoreReader& store, int level) {
  const auto& levels = store.info().levels;
  if (level < 0 || static_cast<std::size_t>(level) >= levels.size())
    throw UsageError(
        fmt::format("there is no level {}; the levels are 0 to {}", level, levels.size() - 1));
  return levels[static_cast<std::size_t>(level)];
}

std::unique_ptr<OpenedVolume> open_volume(const std::string& path, const VolumeRequest& request,
                                          const std::string& cache, std::uint64_t cache_limit,
                                          std::uint64_t remote_limit, std::uint64_t memory,
                                          int threads, const py::object& callback) {
  const OpenOptions options{.volume = request,
                            .cache = {cache, cache_limit, remote_limit},
                            .memory = memory,
                            .threads = threads};
  return interruptible(callback, [&](Reporter reporter) {
    return std::make_unique<OpenedVolume>(path, options, reporter.progress);
  });
}

/// A mesh for each isovalue, made together.
std::vector<std::unique_ptr<Mesh>> extract_meshes(const OpenedVolume& volume,
                                                  ExtractOptions options,
                                                  const MeshFilterOptions& filters,
                                                  const std::vector<double>& isovalues,
                                                  const py::object& callback) {
  return interruptible(callback, [&](Reporter reporter) {
    options.cancel = reporter.cancel;
    std::vector<std::unique_ptr<Mesh>> meshes;
    std::vector<std::unique_ptr<MeshSink>> sinks, filtered;
    std::vector<SurfaceOutput> outputs;
    const MeshFilterOptions filter =
        within_budget(filters, options.memory, isovalues.size(), "-", reporter);
    for (const double isovalue : isovalues) {
      meshes.push_back(std::make_unique<Mesh>());
      sinks.push_back(std::make_unique<MemorySink>(*meshes.back()));
      filtered.push_back(std::make_unique<MeshFilter>(*sinks.back(), filter));
      outputs.push_back({isovalue, options.normals, filtered.back().get()});
    }
    extract(volume.store(), options, outputs, reporter.progress);
    return meshes;
  });
}

std::unique_ptr<Mesh> extract_mesh(const OpenedVolume& volume, const ExtractOptions& options,
                                   const MeshFilterOptions& filters, const py::object& callback) {
  return std::move(extract_meshes(volume, options, filters, {options.isovalue}, callback).front());
}

/// Values at points, rows of x, y, z.
py::array_t<float> sample_points(const OpenedVolume& volume,
                                 const py::array_t<float, py::array::c_style>& points,
                                 const std::string& unit, std::uint64_t memory, int threads) {
  static_assert(sizeof(Vec3f) == 3 * sizeof(float));
  const auto count = static_cast<std::size_t>(points.shape(0));
  py::array_t<float> values(points.shape(0));
  const std::span positions(reinterpret_cast<const Vec3f*>(points.data()), count);
  const std::span<float> out(values.mutable_data(), count);
  run_interruptibly(py::none(), [&](Reporter reporter) {
    VolumeSampler sampler(volume.store(), {.unit = unit, .threads = threads, .memory = memory});
    constexpr std::size_t batch = std::size_t{1} << 18;
    for (std::size_t i = 0; i < count; i += batch) {
      if (reporter.cancel.stop_requested()) throw Cancelled("the operation was cancelled");
      const std::size_t some = std::min(batch, count - i);
      sampler.sample(positions.subspan(i, some), out.subspan(i, some));
    }
  });
  return values;
}

py::dict extract_labels_of(const OpenedVolume& volume, const LabelOptions& options,
                           const py::object& callback) {
  return label_meshes(callback, [&](const LabelVisitor& visit, const Reporter& reporter) {
    LabelOptions cancellable = options;
    cancellable.cancel = reporter.cancel;
    extract_labels(volume.store(), cancellable, visit, reporter.progress);
  });
}

void extract_to(const OpenedVolume& volume, ExtractOptions options, MeshSink& sink,
                const py::object& callback) {
  run_interruptibly(callback, [&](Reporter reporter) {
    options.cancel = reporter.cancel;
    CancellableSink cancellable(sink, reporter.cancel);
    extract(volume.store(), options, cancellable, reporter.progress);
  });
}

std::pair<Vec3d, Vec3d> bounds_of_surface(const OpenedVolume& volume, ExtractOptions options) {
  return interruptible(py::none(), [&](Reporter reporter) {
    options.cancel = reporter.cancel;
    return surface_bounds([&](MeshSink& sink) { extract(volume.store(), options, sink); });
  });
}

py::dict save_mesh(const OpenedVolume& volume, ExtractOptions options,
                   const MeshFilterOptions& filters, const std::string& path,
                   const MeshFileOptions& file,
                   const std::vector<std::pair<std::string, const OpenedVolume*>>& attributes,
                   const ColourArguments& colour_arguments, const py::object& callback) {
  const std::optional<AttributeColours> colours = colours_of(colour_arguments, path);
  std::vector<SampledAttribute> sampled;
  for (const auto& [name, other] : attributes) sampled.push_back({name, &other->store()});
  std::unique_ptr<MeshSink> sink;
  std::unique_ptr<ColourSink> coloured;
  std::unique_ptr<AttributeSink> sampler;
  std::unique_ptr<MeshFilter> filter;
  const ExtractReport report = interruptible(callback, [&](Reporter reporter) {
    options.cancel = reporter.cancel;
    sink = create_mesh_file(path, file);
    if (colours) coloured = std::make_unique<ColourSink>(*sink, *colours);
    if (!sampled.empty()) {
      const SampleOptions usual;
      sampler = std::make_unique<AttributeSink>(
          coloured ? static_cast<MeshSink&>(*coloured) : *sink, sampled,
          SampleOptions{.volume_unit = volume.store().info().levels.front().transform.unit,
                        .threads = options.threads,
                        .memory = std::min(usual.memory, options.memory / 8)});
    }
    filter =
        std::make_unique<MeshFilter>(sampler ? static_cast<MeshSink&>(*sampler) : *sink,
                                     within_budget(filters, options.memory, 1, path, reporter));
    return extract(volume.store(), options, *filter, reporter.progress);
  });
  py::dict result(py::arg("vertices") = report.vertices, py::arg("faces") = report.triangles,
                  py::arg("bricks") = report.bricks, py::arg("bricks_read") = report.bricks_read,
                  py::arg("bytes_read") = report.bytes_read, py::arg("backend") = report.backend,
                  py::arg("seconds") = report.seconds);
  add_filtered(result, *filter);
  return result;
}

py::dict estimate_mesh(const OpenedVolume& volume, const ExtractOptions& options) {
  const ExtractEstimate guess = interruptible(
      py::none(), [&](Reporter) { return estimate(volume.store(), options, std::uint64_t{0}); });
  return py::dict(py::arg("vertices") = guess.mesh.vertices,
                  py::arg("faces") = guess.mesh.triangles,
                  py::arg("uncertainty") = guess.uncertainty);
}

py::array read_samples(const OpenedVolume& volume, int level, Box3 box, int threads) {
  const StoreReader store = volume.store().native();
  const Int3 extent = level_of(store, level).lattice.extent;
  if (box.empty() || !(intersect(box, {{0, 0, 0}, extent}) == box))
    throw UsageError("the box of samples is empty or leaves the volume");
  const Int3 n = box.extent();
  py::array samples(py::dtype(std::string(zarr_name(store.info().type))),
                    std::vector<py::ssize_t>{n.z, n.y, n.x});
  auto* out = static_cast<std::byte*>(samples.mutable_data());
  const Index rows = level_of(store, level).lattice.brick.z;
  run_interruptibly(py::none(), [&](Reporter reporter) {
    Workers workers(threads);
    for (Box3 part = box; part.lo.z < box.hi.z; part.lo.z = part.hi.z) {
      if (reporter.cancel.stop_requested()) return;
      part.hi.z = std::min(box.hi.z, (part.lo.z / rows + 1) * rows);
      const auto before = static_cast<std::size_t>((part.lo.z - box.lo.z) * n.y * n.x);
      workers.execute(
          [&] { read_slab(store, level, part, out + before * size_of(store.info().type)); });
    }
  });
  return samples;
}

std::optional<std::pair<double, double>> range_of(const OpenedVolume& volume) {
  const py::gil_scoped_release release;
  const StoreReader& store = volume.store();
  ValueRange<double> range;
  if (const auto stored = stored_histogram(store)) {
    range = {stored->lo, stored->hi};
  } else if (store.has_ranges(0)) {
    const Box3 bricks{{0, 0, 0}, store.info().levels.front().lattice.bricks()};
    for (const auto& of_brick : store.brick_ranges(0, bricks).ranges) range.include(of_brick);
  }
  if (range.empty()) return std::nullopt;
  return std::pair(range.lo, range.hi);
}

Histogram histogram_of(const StoreReader& store, Progress& progress) {
  if (auto stored = stored_histogram(store)) return std::move(*stored);
  return histogram(store, progress, 1 << 16, true);
}

py::dict read_histogram(const OpenedVolume& volume, int bins, const py::object& callback) {
  return describe(interruptible(callback, [&](Reporter reporter) {
    return histogram(volume.store(), reporter.progress, bins);
  }));
}

std::vector<double> isovalues_of(const OpenedVolume& volume, const std::string& text,
                                 const py::object& callback) {
  return interruptible(callback, [&](Reporter reporter) {
    return resolve_isovalues(parse_isovalues(text), volume.store().info().type,
                             [&] { return histogram_of(volume.store(), reporter.progress); });
  });
}

Suggestion suggestion(const OpenedVolume& volume, const py::object& callback) {
  return pair_of(interruptible(callback, [&](Reporter reporter) {
    const StoreReader& store = volume.store();
    return suggest_isovalue(store.info(), histogram_of(store, reporter.progress));
  }));
}

void export_samples(const OpenedVolume& volume, const std::string& path, const std::string& format,
                    const ExtractOptions& part, std::optional<double> isovalue, int half_band,
                    bool force, const py::object& callback) {
  const ExportOptions options{.format = format == "nrrd"  ? ExportFormat::nrrd
                                        : format == "vdb" ? ExportFormat::vdb
                                        : format == "zip" ? ExportFormat::zip
                                                          : ExportFormat::raw,
                              .isovalue = isovalue,
                              .inside = part.inside,
                              .half_band = half_band,
                              .level = part.level,
                              .roi = part.roi,
                              .force = force,
                              .memory = part.memory,
                              .threads = part.threads};
  run_interruptibly(callback, [&](Reporter reporter) {
    export_volume(volume.store(), path, options, reporter.progress);
  });
}

}  // namespace

void bind_store(py::module_& module) {
  module.def("open", &open_volume);
  module.def("check_attribute_names",
             [](const std::vector<std::string>& names) { check_attribute_names(names); });
  module.def("default_cache_folder", [] { return default_cache_folder().string(); });
  py::class_<OpenedVolume>(module, "Store")
      .def_property_readonly("info",
                             [](const OpenedVolume& v) { return describe(v.store().info()); })
      .def_property_readonly("notes", &OpenedVolume::notes)
      .def_property_readonly("range", &range_of)
      .def("extract", &extract_mesh)
      .def("extract_several", &extract_meshes)
      .def("extract_to", &extract_to)
      .def("extract_labels", &extract_labels_of)
      .def("sample", &sample_points)
      .def("surface_bounds", &bounds_of_surface)
      .def("save_mesh", &save_mesh)
      .def("estimate", &estimate_mesh)
      .def("read", &read_samples)
      .def("histogram", &read_histogram)
      .def("isovalues", &isovalues_of)
      .def("suggested_isovalue", &suggestion)
      .def("export", &export_samples);
}

}  // namespace isobrick::python
