#include <isobrick/mesh.h>

#include <pybind11/numpy.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include <isobrick/attributes.h>
#include <isobrick/error.h>
#include <isobrick/mesh_file_sink.h>
#include <isobrick/mesh_filters.h>
#include "core/box_union.h"
#include "io/meshes/mesh_writing.h"
#include "python/src/bindings.h"
#include "python/src/casters.h"
#include "python/src/colours.h"
#include "python/src/filtered.h"
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

/// The finite vertices' smallest and largest coordinates; zeros where there is none.
MeshBounds bounds_of(const Mesh& mesh) {
  BoxUnion<MeshBounds> all;
  for (const Vec3f& p : mesh.positions.span())
    if (std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z))
      all.include({{p.x, p.y, p.z}, {p.x, p.y, p.z}});
  return all.box().value_or(MeshBounds{});
}

/// Copies triangles of a mesh into chunks that each stand alone.
class ChunkCopier {
 public:
  explicit ChunkCopier(const Mesh& mesh) : mesh_(mesh), numbers_(mesh.positions.size(), kNone) {}

  /// The triangles from `first` on, with the vertices that they name. Valid until the next call.
  MeshChunk copy(std::size_t first, std::size_t count) {
    for (const std::uint32_t vertex : vertices_) numbers_[vertex] = kNone;
    vertices_.clear();
    positions_.clear();
    normals_.clear();
    triangles_.clear();
    for (Triangle triangle : mesh_.triangles.span().subspan(first, count)) {
      for (std::uint32_t& vertex : triangle) vertex = number_of(vertex);
      triangles_.push_back(triangle);
    }
    return {0, positions_, normals_, triangles_};
  }

 private:
  static constexpr auto kNone = std::numeric_limits<std::uint32_t>::max();

  std::uint32_t number_of(std::uint32_t vertex) {
    if (numbers_[vertex] != kNone) return numbers_[vertex];
    numbers_[vertex] = static_cast<std::uint32_t>(vertices_.size());
    vertices_.push_back(vertex);
    positions_.push_back(mesh_.positions[vertex]);
    if (!mesh_.normals.empty()) normals_.push_back(mesh_.normals[vertex]);
    return numbers_[vertex];
  }

  const Mesh& mesh_;
  std::vector<std::uint32_t> numbers_;   ///< of each vertex in the chunk, or kNone
  std::vector<std::uint32_t> vertices_;  ///< of the chunk, as the mesh numbers them
  std::vector<Vec3f> positions_, normals_;
  std::vector<Triangle> triangles_;
};

/// Writes a mesh into a sink that takes chunks which stand alone.
void write_to(const Mesh& mesh, MeshSink& sink, const py::object& callback) {
  constexpr std::size_t batch = std::size_t{1} << 16;
  check_faces(mesh);
  run_interruptibly(callback, [&](Reporter reporter) {
    const MeshBounds bounds = bounds_of(mesh);
    sink.begin({.has_normals = !mesh.normals.empty(),
                .world_lo = bounds.lo,
                .world_hi = bounds.hi,
                .unit = mesh.unit});
    reporter.progress.begin("draw", mesh.triangles.size() * sizeof(Triangle));
    ChunkCopier copier(mesh);
    for (std::size_t at = 0; at < mesh.triangles.size(); at += batch) {
      const std::size_t count = std::min(batch, mesh.triangles.size() - at);
      sink.write(copier.copy(at, count));
      reporter.progress.advance(count * sizeof(Triangle));
    }
    reporter.progress.end();
    sink.finish();
  });
}

using FloatArray = py::array_t<float, py::array::c_style>;

/// `attributes`: a value a vertex each.
void save_mesh_file(const Mesh& mesh, const std::string& path,
                    const std::vector<std::pair<std::string, FloatArray>>& attributes,
                    const ColourArguments& colour_arguments, const MeshFileOptions& options,
                    const py::object& callback) {
  const std::optional<AttributeColours> colours = colours_of(colour_arguments, path);
  std::vector<std::string> names;
  std::vector<VertexAttribute> views;
  for (const auto& [name, values] : attributes) {
    names.push_back(name);
    views.push_back({name, {values.data(), static_cast<std::size_t>(values.size())}});
  }
  check_attribute_names(names);
  run_interruptibly(callback, [&](Reporter reporter) {
    check_faces(mesh);
    if (!colours) return mesh.save(path, options, reporter.progress, views);
    MeshFileOptions heard = options;
    heard.progress = &reporter.progress;
    const std::unique_ptr<MeshSink> sink = create_mesh_file(path, heard);
    ColourSink coloured(*sink, *colours);
    write_mesh(mesh, views, coloured, reporter.progress);
  });
}

}  // namespace

void bind_mesh(py::module_& module) {
  py::class_<MeshSink>(module, "MeshSink");
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
      .def_property_readonly("bounds",
                             [](const Mesh& mesh) {
                               const MeshBounds bounds = bounds_of(mesh);
                               return std::pair(bounds.lo, bounds.hi);
                             })
      .def("write_to", &write_to)
      .def("filtered",
           [](const Mesh& mesh, MeshFilterOptions options, const py::object& callback) {
             return interruptible(callback, [&](Reporter reporter) {
               options.cancel = reporter.cancel;
               options.progress = &reporter.progress;
               return std::make_unique<Mesh>(apply_filters(mesh, options));
             });
           })
      .def("measure",
           [](const Mesh& mesh) {
             return describe(interruptible(py::none(), [&](Reporter) { return measure(mesh); }));
           })
      .def("save", &save_mesh_file);
}

}  // namespace isobrick::python
