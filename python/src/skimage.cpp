#include <pybind11/numpy.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include <isobrick/error.h>
#include <isobrick/mesh.h>
#include "python/src/bindings.h"
#include "python/src/sample_array.h"

// What scikit-image's marching_cubes() returns beyond a mesh, and its masks. Meshes are in index
// space here.
namespace isobrick::python {
namespace {

namespace py = pybind11;

/// The cell that a triangle lies in: its vertices lie on the cell's edges. All extents are 2 or
/// more.
Int3 cell_of(const Mesh& mesh, const Triangle& triangle, Int3 extent) {
  Vec3d sum;
  for (const std::uint32_t vertex : triangle) {
    const Vec3f& p = mesh.positions[vertex];
    sum = sum + Vec3d{p.x, p.y, p.z};
  }
  Int3 cell;
  for (int axis = 0; axis < 3; ++axis)
    cell[axis] =
        std::clamp(static_cast<Index>(std::floor(sum[axis] / 3)), Index{0}, extent[axis] - 2);
  return cell;
}

void check_cells(const Volume& volume) {
  for (int axis = 0; axis < 3; ++axis)
    if (volume.extent[axis] < 2)
      throw UsageError("an array of less than 2×2×2 samples has no cell");
}

/// The largest sample of a cell less the smallest.
template <class T>
float cell_range(const Volume& volume, Int3 cell) {
  const auto* first = static_cast<const std::byte*>(volume.samples) + dot(cell, volume.strides);
  const Int3 s = volume.strides;
  T lo{}, hi{};
  for (unsigned corner = 0; corner < 8; ++corner) {
    const Index offset = (corner & 1 ? s.x : 0) + (corner & 2 ? s.y : 0) + (corner & 4 ? s.z : 0);
    T sample;
    std::memcpy(&sample, first + offset, sizeof(T));
    lo = corner == 0 ? sample : std::min(lo, sample);
    hi = corner == 0 ? sample : std::max(hi, sample);
  }
  return static_cast<float>(static_cast<double>(hi) - static_cast<double>(lo));
}

void raise_to(float& value, float to) {
  const std::atomic_ref<float> shared(value);
  float now = shared.load(std::memory_order_relaxed);
  while (now < to && !shared.compare_exchange_weak(now, to, std::memory_order_relaxed)) {
  }
}

/// For each vertex the largest range of the samples of a cell with a triangle there.
py::array_t<float> vertex_ranges(const Mesh& mesh, const py::array& samples) {
  const Volume volume = volume_of(samples);
  check_cells(volume);
  py::array_t<float> ranges(static_cast<py::ssize_t>(mesh.positions.size()));
  float* out = ranges.mutable_data();
  std::fill(out, out + mesh.positions.size(), 0.0f);
  const py::gil_scoped_release release;
  visit_scalar(volume.type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, mesh.triangles.size(), 4096),
                      [&](const auto& part) {
                        Int3 last{-1, -1, -1};
                        float range = 0;
                        for (std::size_t i = part.begin(); i < part.end(); ++i) {
                          const Int3 cell = cell_of(mesh, mesh.triangles[i], volume.extent);
                          if (!(cell == last)) range = cell_range<T>(volume, cell);
                          last = cell;
                          for (const std::uint32_t vertex : mesh.triangles[i])
                            raise_to(out[vertex], range);
                        }
                      });
  });
  return ranges;
}

/// Keeps the triangles of the cells whose highest corner is set in a mask, and their vertices.
void keep_cells(Mesh& mesh, const py::array& mask) {
  const Volume flags = volume_of(mask, ScalarType::u8);
  check_cells(flags);
  const auto* first = static_cast<const std::byte*>(flags.samples);
  const py::gil_scoped_release release;
  std::size_t kept = 0;
  for (const Triangle& triangle : mesh.triangles.span()) {
    const Int3 corner = cell_of(mesh, triangle, flags.extent) + Int3{1, 1, 1};
    if (first[dot(corner, flags.strides)] != std::byte{0}) mesh.triangles[kept++] = triangle;
  }
  mesh.triangles.resize(kept);
  constexpr auto unused = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> numbers(mesh.positions.size(), unused);
  for (const Triangle& triangle : mesh.triangles.span())
    for (const std::uint32_t vertex : triangle) numbers[vertex] = 0;
  std::uint32_t used = 0;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (numbers[i] == unused) continue;
    mesh.positions[used] = mesh.positions[i];
    if (!mesh.normals.empty()) mesh.normals[used] = mesh.normals[i];
    numbers[i] = used++;
  }
  mesh.positions.resize(used);
  if (!mesh.normals.empty()) mesh.normals.resize(used);
  for (std::size_t i = 0; i < kept; ++i)
    for (std::uint32_t& vertex : mesh.triangles[i]) vertex = numbers[vertex];
}

}  // namespace

void bind_skimage(py::module_& module) {
  module.def("vertex_ranges", &vertex_ranges);
  module.def("keep_cells", &keep_cells);
}

}  // namespace isobrick::python
