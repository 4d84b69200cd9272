#include "python/src/sample_array.h"

#include <fmt/format.h>

#include <bit>
#include <cstring>
#include <memory>
#include <string>
#include <utility>

#include <isobrick/error.h>
#include <isobrick/lattice.h>
#include "python/src/casters.h"

namespace isobrick::python {
namespace {

namespace py = pybind11;

/// Calls a Python function with the bounds of a box, which returns its samples.
class PythonReader {
 public:
  PythonReader(py::object function, ScalarType type)
      : function_(std::move(function)), type_(type) {}

  void operator()(Box3 box, void* out) const {
    const py::gil_scoped_acquire acquire;
    const py::array block = function_(box.lo, box.hi);
    const Int3 n = box.extent();
    const bool fits = block.ndim() == 3 && block.shape(0) == n.z && block.shape(1) == n.y &&
                      block.shape(2) == n.x && scalar_type(block) == type_ &&
                      (block.flags() & py::array::c_style) != 0;
    if (!fits) throw UsageError("what reads samples gave an array of another shape or type");
    std::memcpy(out, block.data(), static_cast<std::size_t>(block.nbytes()));
  }

 private:
  py::object function_;
  ScalarType type_;
};

}  // namespace

std::optional<ScalarType> scalar_type(char kind, py::ssize_t bytes) {
  if (kind == 'b') kind = 'u';
  for (const ScalarType type : kScalarTypes) {
    const char* name = zarr_name(type).data();
    if (name[0] == kind && size_of(type) == static_cast<std::size_t>(bytes)) return type;
  }
  return std::nullopt;
}

std::optional<ScalarType> scalar_type(const py::array& array) {
  constexpr char other = std::endian::native == std::endian::little ? '>' : '<';
  const py::dtype type = array.dtype();
  const char order = py::cast<std::string>(type.attr("byteorder")).front();
  return order == other ? std::nullopt : scalar_type(type.kind(), type.itemsize());
}

Volume volume_of(const py::array& array, ScalarType type) {
  if (array.ndim() != 3)
    throw UsageError(fmt::format("a volume has three axes [z, y, x], this array {}", array.ndim()));
  Volume volume;
  volume.samples = array.data();
  volume.type = type;
  for (int axis = 0; axis < 3; ++axis) {
    volume.extent[2 - axis] = array.shape(axis);
    volume.strides[2 - axis] = array.strides(axis);
    if (array.shape(axis) == 1)
      volume.strides[2 - axis] = array.itemsize();  // it is of no matter, and must not be 0
    else if (array.strides(axis) == 0)
      throw UsageError("an array that repeats its samples (numpy.broadcast_to) must be copied");
  }
  if (!checked_volume(volume.extent))
    throw UsageError(fmt::format("an array of shape ({}, {}, {}) has no samples", volume.extent.z,
                                 volume.extent.y, volume.extent.x));
  return volume;
}

Volume volume_of(const py::array& array) {
  const std::optional<ScalarType> type = scalar_type(array);
  if (!type)
    throw UsageError(fmt::format("samples of dtype {} are not supported",
                                 py::cast<std::string>(py::str(array.dtype()))));
  return volume_of(array, *type);
}

Volume volume_of(const py::object& read, Int3 extent, ScalarType type) {
  Volume volume;
  volume.extent = extent;
  volume.type = type;
  // A copy of a std::function must not count references without the GIL.
  volume.read = [reader = std::make_shared<const PythonReader>(read, type)](Box3 box, void* out) {
    (*reader)(box, out);
  };
  return volume;
}

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

}  // namespace isobrick::python
