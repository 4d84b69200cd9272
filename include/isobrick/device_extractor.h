#pragma once

#include <memory>

#include <isobrick/api.h>
#include <isobrick/device_array.h>
#include <isobrick/device_mesh.h>
#include <isobrick/extract.h>

namespace isobrick::inline v0 {

/// A mesh that a device is making.
class ISOBRICK_API PendingDeviceMesh {
 public:
  struct Impl;  ///< private to the library

  /// For the library itself.
  explicit PendingDeviceMesh(std::unique_ptr<Impl> impl);
  ~PendingDeviceMesh();
  /// Takes the mesh of another.
  PendingDeviceMesh(PendingDeviceMesh&&) noexcept;

  /// Whether get() has nothing to wait for.
  bool is_ready() const;
  /// The mesh, once its size is known: the device may still be writing it (DeviceMesh::ready()). A
  /// mesh that did not fit the memory which was taken for it is made again. Once. Throws UsageError
  /// when the extractor has begun another, OutOfDeviceMemory, what went wrong on the device.
  DeviceMesh get();

 private:
  std::unique_ptr<Impl> impl_;
};

/// Isosurfaces of samples in device memory, byte for byte those of the CPU. Samples and mesh stay
/// on the device. Not thread-safe.
///
/// Of an array: the constructor reads the samples once and finds their ranges. Each isovalue then
/// reads only the blocks of 32³ samples that it touches. It copies those which no isovalue before
/// has touched; the copies and the mesh are all the memory that is taken. The array must stay as it
/// is.
///
/// Of a store: the constructor reads a level, or a region of it, to the device, which decodes
/// packed bricks itself. Each isovalue then reads the blocks that it touches.
///
/// Of the ExtractOptions of a surface, `isovalue`, `roi`, `inside`, `normals`, `drop_degenerate`,
/// `topology`, `cap` and `gpu_memory` matter; `inside` is above by default, but for a store's level
/// set; `gpu_memory` is without bound. The calling thread's current device is afterwards what it
/// was before.
class ISOBRICK_API DeviceExtractor {
 public:
  struct Impl;  ///< private to the library

  /// Waits until the ranges are known. Throws UsageError for an array that makes no sense: no
  /// samples or not of a device, an extent that is not positive, strides of which one is 0 or no
  /// multiple of a sample; gpu::OutOfDeviceMemory; Error where there is no CUDA.
  explicit DeviceExtractor(const DeviceArray& array);
  /// Reads the samples of a level to `options.device` and waits. Of the options, `level`, `roi`,
  /// `device`, `memory`, `gpu_memory`, `threads` and `cancel` matter; surfaces then lie within that
  /// region of that level. The samples take a 32nd more than their bytes of device memory, and
  /// while they are read a pool of bricks lies beside them, some hundred megabytes. Throws as
  /// extract() of a store does; UsageError where `gpu_memory` or `memory` is too small for them,
  /// gpu::OutOfDeviceMemory where the device is; Error where there is no CUDA. The store is not
  /// needed any more afterwards.
  DeviceExtractor(const StoreReader& store, const ExtractOptions& options,
                  const DeviceTarget& target = {}, Progress& progress = no_progress());
  ~DeviceExtractor();
  /// Takes the samples of another.
  DeviceExtractor(DeviceExtractor&&) noexcept;

  /// Waits until the size of the mesh is known, not until it is written. Throws UsageError for
  /// another level or region than was read, an isovalue that is not a number, a region without
  /// samples and for `gpu_memory` that is too small; gpu::OutOfDeviceMemory.
  DeviceMesh extract(const ExtractOptions& options);
  /// Waits for nothing. The memory for the mesh is what the last one needed, some for the first.
  PendingDeviceMesh extract_async(const ExtractOptions& options);

 private:
  std::shared_ptr<Impl> impl_;
};

/// A surface of an array in device memory in one go: DeviceExtractor.
ISOBRICK_API DeviceMesh extract(const DeviceArray& array, const ExtractOptions& options);

/// A surface of a store, on the device: the mesh of extract(), byte for byte. Reads only the bricks
/// that the isovalue touches, as DeviceExtractor does, and throws as it does.
ISOBRICK_API DeviceMesh extract_to_device(const StoreReader& store, const ExtractOptions& options,
                                          const DeviceTarget& target = {},
                                          Progress& progress = no_progress());

}  // namespace isobrick
