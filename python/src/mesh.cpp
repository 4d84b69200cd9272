#include <isobrick/mesh.h>

#include <pybind11/numpy.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <string>

#include <fmt/format.h>

#include <isobrick/error.h>
#include <isobrick/mesh_file_sink.h>
#include "python/src/bindings.h"
#include "python/src/casters.h"
#include "python/src/interruptible.h"

namespace isobrick::python {
namespace {

/// Rows of three numbers in the mesh's own memory. The array keeps the mesh alive.
template <class T, class Row>
py::array rows_of(py::object mesh, PodBuffer<Row>& rows) {
  static_assert(sizeof(Row) == 3 * sizeof(T));
  if (rows.empty()) return py::array_t<T>(std::vector<py::ssize_t>{0, 3});
  return py::array_t<T>({static_cast<py::ssize_t>(rows.size()), py::ssize_t{3}},
                        reinterpret_cast<T*>(rows.data()), std::move(mesh));
}

template <class T, class Row>
void copy_rows(const py::array_t<T, py::array::c_style>& from, PodBuffer<Row>& to) {
  if (from.ndim() != 2 || from.shape(1) != 3) throw UsageError("rows of three numbers are needed");
  to.resize(static_cast<std::size_t>(from.shape(0)));
  if (!to.empty()) std::memcpy(static_cast<void*>(to.data()), from.data(), to.size() * sizeof(Row));
}

/// The arrays can be changed from Python, and files are written from what they name.
void check_faces(const Mesh& mesh) {
  std::uint32_t largest = 0;
  for (const Triangle& t : mesh.triangles.span()) largest = std::max({largest, t[0], t[1], t[2]});
  if (!mesh.triangles.empty() && largest >= mesh.positions.size())
    throw UsageError(fmt::format("a face names vertex {}, but the mesh has {} vertices", largest,
                                 mesh.positions.size()));
}

std::unique_ptr<Mesh> make_mesh(const py::array_t<float, py::array::c_style>& vertices,
                                const py::array_t<std::uint32_t, py::array::c_style>& faces,
                                const py::object& normals, const std::string& unit) {
  auto mesh = std::make_unique<Mesh>();
  copy_rows(vertices, mesh->positions);
  copy_rows(faces, mesh->triangles);
  if (!normals.is_none())
    copy_rows(py::cast<py::array_t<float, py::array::c_style>>(normals), mesh->normals);
  if (!mesh->normals.empty() && mesh->normals.size() != mesh->positions.size())
    throw UsageError("a mesh has one normal a vertex, or none");
  mesh->unit = unit;
  check_faces(*mesh);
  return mesh;
}

}  // namespace

void bind_mesh(py::module_& module) {
  py::class_<Mesh>(module, "Mesh")
      .def(py::init(&make_mesh))
      .def_property_readonly(
          "vertices",
          [](py::object self) { return rows_of<float>(self, self.cast<Mesh&>().positions); })
      .def_property_readonly(
          "normals",
          [](py::object self) { return rows_of<float>(self, self.cast<Mesh&>().normals); })
      .def_property_readonly("faces",
                             [](py::object self) {
                               return rows_of<std::uint32_t>(self, self.cast<Mesh&>().triangles);
                             })
      .def_readwrite("unit", &Mesh::unit)
      .def("save", [](const Mesh& mesh, const std::string& path, const MeshFileOptions& options) {
        check_faces(mesh);
        run_interruptibly(py::none(), [&](Reporter) { mesh.save(path, options); });
      });
}

}  // namespace isobrick::python
