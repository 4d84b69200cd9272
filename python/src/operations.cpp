#include <pybind11/numpy.h>
#include <tbb/parallel_for.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <isobrick/convert.h>
#include <isobrick/error.h>
#include <isobrick/index_build.h>
#include <isobrick/label_index.h>
#include <isobrick/open_source.h>
#include <isobrick/recode.h>
#include <isobrick/synth_source.h>
#include <isobrick/verify.h>
#include "bricks/zarr/metadata_files.h"
#include "pipeline/convert/store_source.h"
#include "pipeline/workers.h"
#include "python/src/array_source.h"
#include "python/src/bindings.h"
#include "python/src/casters.h"
#include "python/src/descriptions.h"
#include "python/src/interruptible.h"
#include "python/src/sample_array.h"

namespace isobrick::python {
namespace {

void bind_convert_options(py::module_& module) {
  py::class_<ConvertOptions>(module, "ConvertOptions")
      .def(py::init<>())
      .def_readwrite("brick", &ConvertOptions::brick)
      .def_readwrite("shard", &ConvertOptions::shard)
      .def("set_packed", [](ConvertOptions& o) { o.codec = BrickCodec::packed; })
      .def("set_automatic", [](ConvertOptions& o) { o.codec = BrickCodec::automatic; })
      .def("set_uncompressed", [](ConvertOptions& o) { o.codec = BrickCodec::none; })
      .def_readwrite("zstd_level", &ConvertOptions::zstd_level)
      .def_readwrite("levels", &ConvertOptions::levels)
      .def_readwrite("memory", &ConvertOptions::memory)
      .def_readwrite("threads", &ConvertOptions::threads)
      .def_readwrite("resume", &ConvertOptions::resume)
      .def_readwrite("force", &ConvertOptions::force)
      .def_readwrite("leaf", &ConvertOptions::leaf)
      .def_property(
          "ome_04", [](const ConvertOptions& o) { return o.ome == OmeVersion::v04; },
          [](ConvertOptions& o, bool old) { o.ome = old ? OmeVersion::v04 : OmeVersion::v05; })
      .def("set_downsampling",
           [](ConvertOptions& o, const std::string& name) {
             const auto downsampling = parse_downsampling(name);
             if (downsampling) o.downsampling = *downsampling;
             return downsampling.has_value();
           })
      .def("set_index", [](ConvertOptions& o, const std::string& name) {
        o.index = parse_index_kind(name);
        return o.index.has_value();
      });
}

py::dict convert_file(const std::string& path, const std::string& out, const VolumeRequest& request,
                      ConvertOptions options, const py::object& callback) {
  options.inputs = {path};
  return describe(interruptible(callback, [&](Reporter reporter) {
    const auto source = open_any_source(path, request);
    return convert(*source, out, options, reporter.progress);
  }));
}

py::dict convert_volume(Volume volume, std::size_t memory, const Transform& transform,
                        const std::string& out, const ConvertOptions& options,
                        const py::object& callback) {
  volume.transform = transform;
  return describe(interruptible(callback, [&](Reporter reporter) {
    ArraySource source(volume, "array", memory);
    return convert(source, out, options, reporter.progress);
  }));
}

py::dict convert_array(const py::array& array, const Transform& transform,
                       std::optional<double> nodata, const py::object& mask, const std::string& out,
                       const ConvertOptions& options, const py::object& callback) {
  Volume volume = volume_of(array);
  add_missing(volume, nodata, mask);
  return convert_volume(volume, 0, transform, out, options, callback);
}

py::dict convert_function(const py::object& read, Int3 extent, ScalarType type, std::size_t memory,
                          const Transform& transform, std::optional<double> nodata,
                          const py::object& mask, const std::string& out,
                          const ConvertOptions& options, const py::object& callback) {
  Volume volume = volume_of(read, extent, type);
  add_missing(volume, nodata, mask);
  return convert_volume(volume, memory, transform, out, options, callback);
}

/// Of the options those that concern a store which is there already.
py::dict recode_store(const std::string& path, const std::string& out,
                      const ConvertOptions& options, const py::object& callback) {
  return describe(interruptible(callback, [&](Reporter reporter) {
    return recode(StoreReader(path), out,
                  {.codec = options.codec,
                   .zstd_level = options.zstd_level,
                   .packed_factor = options.packed_factor,
                   .memory = options.memory,
                   .threads = options.threads,
                   .resume = options.resume,
                   .force = options.force,
                   .cancel = reporter.cancel},
                  reporter.progress);
  }));
}

py::dict describe_index(const IndexReport& report) {
  return py::dict(py::arg("level_bytes") = report.level_bytes,
                  py::arg("ranges_added") = report.ranges_added,
                  py::arg("seconds") = report.seconds);
}

/// Lists of labels, which have no leaf.
py::dict index_labels(const std::string& path, Index leaf, const VolumeRequest& request,
                      bool resume, bool force, const py::object& callback) {
  if (leaf != IndexOptions().leaf)
    throw UsageError("lists of labels are of 32 cells along each edge: leave out leaf");
  return describe_index(interruptible(callback, [&](Reporter reporter) {
    return add_label_index(path,
                           {.selection = request.selection,
                            .memory = request.memory.value_or(std::uint64_t{1} << 30),
                            .threads = request.threads,
                            .resume = resume,
                            .force = force,
                            .cancel = reporter.cancel},
                           reporter.progress);
  }));
}

py::dict index_store(const std::string& path, const std::string& kind, Index leaf,
                     const VolumeRequest& request, bool resume, bool force,
                     const py::object& callback) {
  if (kind == "labels") return index_labels(path, leaf, request, resume, force, callback);
  const auto parsed = parse_index_kind(kind);
  if (!parsed)
    throw UsageError("the kinds are linear, interval, kdtree, quadtree, octree and labels");
  const IndexOptions options{.kind = *parsed,
                             .selection = request.selection,
                             .leaf = leaf,
                             .memory = request.memory.value_or(std::uint64_t{1} << 30),
                             .threads = request.threads,
                             .resume = resume,
                             .force = force};
  return describe_index(interruptible(
      callback, [&](Reporter reporter) { return add_index(path, options, reporter.progress); }));
}

py::dict verify_store(const std::string& path, const VolumeRequest& request,
                      const py::object& callback) {
  const VerifyReport report = interruptible(callback, [&](Reporter reporter) {
    return verify(path,
                  {.threads = request.threads,
                   .selection = request.selection,
                   .memory = request.memory.value_or(std::uint64_t{1} << 30),
                   .cancel = reporter.cancel},
                  reporter.progress);
  });
  return py::dict(py::arg("whole") = report.damage_count == 0, py::arg("bricks") = report.bricks,
                  py::arg("bytes_read") = report.bytes,
                  py::arg("damage_count") = report.damage_count,
                  py::arg("damages") = report.damages);
}

py::dict describe_path(const std::string& path, const VolumeRequest& request) {
  if (is_zarr(path))
    return describe(interruptible(
        py::none(), [&](Reporter) { return StoreReader(path, request.selection).info(); }));
  return describe(
      interruptible(py::none(), [&](Reporter) { return open_source(path, request)->info(); }));
}

std::unique_ptr<VolumeSource> synth_source(const std::string& kind, Int3 extent, ScalarType type,
                                           std::uint64_t seed, std::optional<double> frequency,
                                           double noise) {
  const auto parsed = parse_synth_kind(kind);
  if (!parsed) throw UsageError("the kinds are sphere, gyroid, marschner-lobb, mixing and cells");
  return make_synth({.kind = *parsed,
                     .extent = extent,
                     .type = type,
                     .seed = seed,
                     .frequency = frequency,
                     .noise = noise});
}

py::array synth_array(const std::string& kind, Int3 extent, ScalarType type, std::uint64_t seed,
                      std::optional<double> frequency, double noise) {
  const auto source = synth_source(kind, extent, type, seed, frequency, noise);
  py::array samples(py::dtype(std::string(zarr_name(type))),
                    std::vector<py::ssize_t>{extent.z, extent.y, extent.x});
  auto* out = static_cast<std::byte*>(samples.mutable_data());
  const std::size_t plane = static_cast<std::size_t>(extent.x * extent.y) * size_of(type);
  run_interruptibly(py::none(), [&](Reporter reporter) {
    Workers workers(0);
    workers.execute([&] {
      tbb::parallel_for(Index{0}, extent.z, [&](Index z) {
        if (reporter.cancel.stop_requested()) return;
        source->read({{0, 0, z}, {extent.x, extent.y, z + 1}},
                     out + static_cast<std::size_t>(z) * plane);
      });
    });
  });
  return samples;
}

py::dict synth_store(const std::string& out, const std::string& kind, Int3 extent, ScalarType type,
                     std::uint64_t seed, std::optional<double> frequency, double noise,
                     const ConvertOptions& options, const py::object& callback) {
  return describe(interruptible(callback, [&](Reporter reporter) {
    const auto source = synth_source(kind, extent, type, seed, frequency, noise);
    return convert(*source, out, options, reporter.progress);
  }));
}

}  // namespace

void bind_operations(py::module_& module) {
  bind_convert_options(module);
  module.def("convert_file", &convert_file);
  module.def("convert_array", &convert_array);
  module.def("convert_function", &convert_function);
  module.def("recode", &recode_store);
  module.def("index", &index_store);
  module.def("verify", &verify_store);
  module.def("describe", &describe_path);
  module.def("synth_array", &synth_array);
  module.def("synth_store", &synth_store);
}

}  // namespace isobrick::python
