#include <isobrick/device_extractor.h>

#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include <isobrick/error.h>
#include <isobrick/open_volume.h>
#include <isobrick/store_reader.h>
#include "python/src/bindings.h"
#include "python/src/casters.h"
#include "python/src/dlpack.h"
#include "python/src/interruptible.h"
#include "python/src/sample_array.h"

// Samples in the memory of a device: arrays as __cuda_array_interface__ and DLPack describe them,
// and what was read of a volume.

namespace isobrick::python {
namespace {

namespace py = pybind11;
using dlpack::ManagedTensor;

CUstream_st* stream_of(std::uintptr_t stream) { return reinterpret_cast<CUstream_st*>(stream); }

/// Strides (z, y, x) in bytes; along an axis of one sample they are of no matter.
void set_strides(DeviceArray& array, Int3 strides) {
  const auto bytes = static_cast<Index>(size_of(array.type));
  for (int axis = 0; axis < 3; ++axis)
    array.strides[axis] = array.extent[axis] == 1 ? bytes : strides[axis];
}

DeviceArray array_of(std::uintptr_t pointer, Int3 extent, std::optional<Int3> strides, char kind,
                     py::ssize_t bytes) {
  const auto type = scalar_type(kind, bytes);
  if (!type)
    throw UsageError(
        fmt::format("samples of kind '{}' with {} bytes are not supported", kind, bytes));
  DeviceArray array;
  array.samples = reinterpret_cast<const void*>(pointer);
  array.type = *type;
  array.extent = extent;
  if (strides) set_strides(array, *strides);
  return array;
}

/// A tensor that another library has put into a capsule, which is taken from it.
class TakenTensor {
 public:
  explicit TakenTensor(const py::capsule& capsule)
      : managed_(static_cast<ManagedTensor*>(PyCapsule_GetPointer(capsule.ptr(), "dltensor"))) {
    if (!managed_) throw py::error_already_set();
    PyCapsule_SetName(capsule.ptr(), "used_dltensor");
  }
  TakenTensor(const TakenTensor&) = delete;
  TakenTensor& operator=(const TakenTensor&) = delete;
  ~TakenTensor() {
    if (managed_->deleter) managed_->deleter(managed_);
  }

  DeviceArray array() const {
    const dlpack::Tensor& tensor = managed_->tensor;
    if (tensor.device.type != dlpack::kCuda && tensor.device.type != dlpack::kManaged)
      throw UsageError("the array is not in the memory of a CUDA device");
    if (tensor.ndim != 3)
      throw UsageError(
          fmt::format("a volume has three axes [z, y, x], this array {}", tensor.ndim));
    const Index bytes = tensor.dtype.bits / 8;
    const char kind = tensor.dtype.lanes != 1               ? '?'
                      : tensor.dtype.code == dlpack::kFloat ? 'f'
                      : tensor.dtype.code == dlpack::kInt   ? 'i'
                      : tensor.dtype.code == dlpack::kUInt  ? 'u'
                      : tensor.dtype.code == dlpack::kBool  ? 'b'
                                                            : '?';
    std::optional<Int3> strides;
    if (const std::int64_t* s = tensor.strides) strides = Int3{s[2], s[1], s[0]} * bytes;
    return array_of(reinterpret_cast<std::uintptr_t>(tensor.data) + tensor.byte_offset,
                    {tensor.shape[2], tensor.shape[1], tensor.shape[0]}, strides, kind, bytes);
  }

 private:
  ManagedTensor* managed_;
};

/// Surfaces of samples in device memory.
class PythonDeviceExtractor {
 public:
  PythonDeviceExtractor(const DeviceArray& array, std::unique_ptr<const TakenTensor> tensor)
      : tensor_(std::move(tensor)), extractor_(array), extent_(array.extent), type_(array.type) {}
  PythonDeviceExtractor(DeviceExtractor extractor, Int3 extent, ScalarType type)
      : extractor_(std::move(extractor)), extent_(extent), type_(type) {}

  DeviceMesh extract(const ExtractOptions& options) {
    const py::gil_scoped_release release;
    const std::lock_guard lock(mutex_);
    return extractor_.extract(options);
  }
  Int3 shape() const { return extent_; }
  std::string type() const { return std::string(zarr_name(type_)); }

 private:
  std::unique_ptr<const TakenTensor> tensor_;  ///< an array's memory; null: the package keeps it
  std::mutex mutex_;
  DeviceExtractor extractor_;
  Int3 extent_;
  ScalarType type_;
};

std::unique_ptr<PythonDeviceExtractor> extractor_of_store(const OpenedVolume& volume,
                                                          ExtractOptions options,
                                                          std::uintptr_t stream,
                                                          const py::object& callback) {
  return interruptible(callback, [&](Reporter reporter) {
    options.cancel = reporter.cancel;
    const StoreReader& store = volume.store();
    DeviceExtractor extractor(store, options, {.stream = stream_of(stream)}, reporter.progress);
    const auto level = static_cast<std::size_t>(options.level);
    return std::make_unique<PythonDeviceExtractor>(
        std::move(extractor), store.info().levels[level].lattice.extent, store.info().type);
  });
}

DeviceMesh mesh_of_store(const OpenedVolume& volume, ExtractOptions options, std::uintptr_t stream,
                         const py::object& callback) {
  return interruptible(callback, [&](Reporter reporter) {
    options.cancel = reporter.cancel;
    return extract_to_device(volume.store(), options, {.stream = stream_of(stream)},
                             reporter.progress);
  });
}

std::unique_ptr<PythonDeviceExtractor> extractor_of(
    DeviceArray array, const Transform& transform, std::uintptr_t stream,
    std::unique_ptr<const TakenTensor> tensor = {}) {
  array.transform = transform;
  array.stream = stream_of(stream);
  const py::gil_scoped_release release;
  return std::make_unique<PythonDeviceExtractor>(array, std::move(tensor));
}

/// An array of a mesh: rows of three numbers of 32 bits.
struct MeshRows {
  const void* data;
  std::int64_t rows;
  bool are_floats;
};

MeshRows rows_of(const DeviceMesh& mesh, const std::string& name) {
  if (name == "faces")
    return {mesh.triangles().data(), static_cast<std::int64_t>(mesh.triangles().size()), false};
  const auto vectors = name == "normals" ? mesh.normals() : mesh.positions();
  return {vectors.data(), static_cast<std::int64_t>(vectors.size()), true};
}

/// What a capsule of a mesh's array keeps.
struct SharedRows {
  DeviceMesh mesh;
  std::array<std::int64_t, 2> shape;
  ManagedTensor managed;
};

py::capsule capsule_of(const DeviceMesh& mesh, const std::string& name,
                       std::optional<std::uintptr_t> stream) {
  if (stream) mesh.precede(stream_of(*stream));
  const MeshRows rows = rows_of(mesh, name);
  auto shared = std::make_unique<SharedRows>(SharedRows{mesh, {rows.rows, 3}, {}});
  ManagedTensor& managed = shared->managed;
  managed.tensor = {.data = const_cast<void*>(rows.data),
                    .device = {dlpack::kCuda, std::max(0, mesh.device())},
                    .ndim = 2,
                    .dtype = {rows.are_floats ? dlpack::kFloat : dlpack::kUInt, 32, 1},
                    .shape = shared->shape.data(),
                    .strides = nullptr,
                    .byte_offset = 0};
  managed.owner = shared.get();
  managed.deleter = [](ManagedTensor* self) { delete static_cast<SharedRows*>(self->owner); };
  // What nobody has taken goes with the capsule.
  py::capsule capsule(&managed, "dltensor", [](PyObject* object) {
    if (!PyCapsule_IsValid(object, "dltensor")) return;
    auto* const kept = static_cast<ManagedTensor*>(PyCapsule_GetPointer(object, "dltensor"));
    kept->deleter(kept);
  });
  shared.release();
  return capsule;
}

std::uintptr_t number_of(CUstream_st* stream) { return reinterpret_cast<std::uintptr_t>(stream); }

void bind_device_mesh(py::module_& module) {
  py::class_<DeviceMesh>(module, "DeviceMesh")
      .def_property_readonly("device", &DeviceMesh::device)
      .def_property_readonly("stream",
                             [](const DeviceMesh& mesh) { return number_of(mesh.stream()); })
      .def("rows",
           [](const DeviceMesh& mesh, const std::string& name) {
             const MeshRows rows = rows_of(mesh, name);
             return py::make_tuple(reinterpret_cast<std::uintptr_t>(rows.data), rows.rows);
           })
      .def("dlpack", &capsule_of)
      .def("download", [](const DeviceMesh& mesh) {
        const py::gil_scoped_release release;
        return std::make_unique<Mesh>(mesh.download());
      });
}

}  // namespace

void bind_device(py::module_& module) {
  bind_device_mesh(module);
  module.def("extract_to_device", &mesh_of_store);
  py::class_<PythonDeviceExtractor>(module, "DeviceExtractor")
      .def_static("of_pointer",
                  [](std::uintptr_t pointer, Int3 shape, std::optional<Int3> strides, char kind,
                     py::ssize_t bytes, const Transform& transform, std::uintptr_t stream) {
                    return extractor_of(array_of(pointer, shape, strides, kind, bytes), transform,
                                        stream);
                  })
      .def_static(
          "of_capsule",
          [](const py::capsule& capsule, const Transform& transform, std::uintptr_t stream) {
            auto tensor = std::make_unique<const TakenTensor>(capsule);
            const DeviceArray array = tensor->array();
            return extractor_of(array, transform, stream, std::move(tensor));
          })
      .def_static("of_volume", &extractor_of_store)
      .def("extract", &PythonDeviceExtractor::extract)
      .def_property_readonly("shape", &PythonDeviceExtractor::shape)
      .def_property_readonly("dtype", &PythonDeviceExtractor::type);
}

}  // namespace isobrick::python
