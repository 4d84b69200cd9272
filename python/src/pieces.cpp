#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <isobrick/label_pieces.h>
#include <isobrick/mesh_file_sink.h>
#include <isobrick/mesh_sinks.h>
#include <isobrick/open_volume.h>
#include <isobrick/pieces.h>
#include "python/src/bindings.h"
#include "python/src/filtered.h"
#include "python/src/interruptible.h"
#include "python/src/labels.h"

namespace isobrick::python {
namespace {

py::dict extract_piece_of(const OpenedVolume& volume, ExtractOptions options, std::uint32_t number,
                          std::uint32_t count, const std::string& path, bool force,
                          const py::object& callback) {
  const PieceReport report = interruptible(callback, [&](Reporter reporter) {
    options.cancel = reporter.cancel;
    return extract_piece(volume.store(), options, {number, count}, path, force, reporter.progress);
  });
  return py::dict(py::arg("vertices") = report.surface.vertices,
                  py::arg("faces") = report.surface.triangles, py::arg("kept") = report.is_kept,
                  py::arg("bytes") = report.bytes);
}

/// Puts pieces together into a sink, by way of filters.
std::unique_ptr<MeshFilter> merge_into(MeshSink& sink, const std::vector<std::string>& pieces,
                                       MeshFilterOptions filters, std::uint64_t memory,
                                       const std::string& path, const Reporter& reporter) {
  filters.takes_welded = true;
  const std::vector<std::filesystem::path> paths(pieces.begin(), pieces.end());
  auto filter =
      std::make_unique<MeshFilter>(sink, within_budget(filters, memory, 1, path, reporter));
  merge_pieces(paths, *filter, {.memory = memory, .cancel = reporter.cancel}, reporter.progress);
  return filter;
}

std::unique_ptr<Mesh> merge_mesh(const std::vector<std::string>& pieces,
                                 const MeshFilterOptions& filters, std::uint64_t memory,
                                 const py::object& callback) {
  return interruptible(callback, [&](Reporter reporter) {
    auto mesh = std::make_unique<Mesh>();
    MemorySink sink(*mesh);
    merge_into(sink, pieces, filters, memory, "-", reporter);
    return mesh;
  });
}

py::dict merge_to_file(const std::vector<std::string>& pieces, const MeshFilterOptions& filters,
                       const std::string& path, const MeshFileOptions& file,
                       const py::object& callback) {
  std::unique_ptr<MeshSink> sink;
  const std::unique_ptr<MeshFilter> filter = interruptible(callback, [&](Reporter reporter) {
    sink = create_mesh_file(path, file);
    return merge_into(*sink, pieces, filters, file.memory, path, reporter);
  });
  py::dict result;
  add_filtered(result, *filter);
  return result;
}

py::dict extract_label_piece_of(const OpenedVolume& volume, LabelOptions options,
                                std::uint32_t number, std::uint32_t count, const std::string& path,
                                bool force, const py::object& callback) {
  const LabelPieceReport report = interruptible(callback, [&](Reporter reporter) {
    options.cancel = reporter.cancel;
    return extract_label_piece(volume.store(), options, {number, count}, path, force,
                               reporter.progress);
  });
  return py::dict(py::arg("vertices") = report.pass.vertices,
                  py::arg("faces") = report.pass.triangles, py::arg("kept") = report.is_kept,
                  py::arg("bytes") = report.bytes);
}

py::dict merge_labels(const std::vector<std::string>& pieces, std::uint64_t memory, int threads,
                      const py::object& callback) {
  const std::vector<std::filesystem::path> paths(pieces.begin(), pieces.end());
  return label_meshes(callback, [&](const LabelVisitor& visit, const Reporter& reporter) {
    merge_label_pieces(paths, {.memory = memory, .threads = threads, .cancel = reporter.cancel},
                       visit, reporter.progress);
  });
}

}  // namespace

void bind_pieces(py::module_& module) {
  module.def("extract_piece", &extract_piece_of);
  module.def("merge_mesh", &merge_mesh);
  module.def("merge_to_file", &merge_to_file);
  module.def("extract_label_piece", &extract_label_piece_of);
  module.def("merge_labels", &merge_labels);
}

}  // namespace isobrick::python
