#pragma once

#include <pybind11/pybind11.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>

#include <isobrick/mesh_filters.h>
#include "python/src/casters.h"
#include "python/src/interruptible.h"

namespace isobrick::python {

/// What a mesh measures, with the names of isobrick.Measure.
inline pybind11::dict describe(const MeshMeasure& m) {
  namespace py = pybind11;
  py::object volume = py::none(), bounds = py::none();
  if (m.volume) volume = py::float_(*m.volume);
  if (m.bounds) bounds = py::cast(std::pair(m.bounds->lo, m.bounds->hi));
  return py::dict(py::arg("vertices") = m.vertices, py::arg("faces") = m.triangles,
                  py::arg("area") = m.area, py::arg("volume") = volume,
                  py::arg("open_sides") = m.open_sides, py::arg("components") = m.components,
                  py::arg("euler_number") = m.euler_number, py::arg("bounds") = bounds,
                  py::arg("unit") = m.unit);
}

/// These filters within the budget of an extraction into so many meshes. Scratch files lie beside
/// `path`.
inline MeshFilterOptions within_budget(MeshFilterOptions filters, std::uint64_t memory,
                                       std::size_t meshes, const std::string& path,
                                       const Reporter& reporter) {
  constexpr std::uint64_t least = std::uint64_t{8} << 20;
  filters.memory = std::max(least, memory / 4 / std::max<std::size_t>(1, meshes));
  filters.scratch_beside = path;
  filters.cancel = reporter.cancel;
  if (meshes == 1) filters.progress = &reporter.progress;
  return filters;
}

/// Puts the size of the mesh that a filter wrote, and what it measures, in place of what the
/// extraction reports.
inline void add_filtered(pybind11::dict& report, const MeshFilter& filter) {
  report["vertices"] = filter.size().vertices;
  report["faces"] = filter.size().triangles;
  if (const auto measure = filter.measure()) report["measure"] = describe(*measure);
}

}  // namespace isobrick::python
