#pragma once

#include <cstddef>
#include <memory>

#include <isobrick/api.h>
#include <isobrick/scalar.h>
#include <isobrick/transform.h>
#include <isobrick/vec.h>

struct CUstream_st;  // cudaStream_t points to one

namespace isobrick::inline v0 {

/// Where device memory comes from: RMM's resources and PyTorch's allocator fit. Called on any
/// thread, with the device that the memory is for as the current one.
class ISOBRICK_API DeviceMemory {
 public:
  virtual ~DeviceMemory() = default;
  /// At least `bytes` of memory, aligned to 256 bytes, for work that follows in the stream. Throws
  /// when there is none.
  virtual void* allocate(std::size_t bytes, CUstream_st* stream) = 0;
  /// Takes back what allocate() gave: work that is in the stream may still use it.
  virtual void free(void* memory, std::size_t bytes, CUstream_st* stream) noexcept = 0;
};

/// What the work and the memory of surfaces on a device belong to.
struct DeviceTarget {
  /// All work and all memory are of this stream (a cudaStream_t), which must outlive the meshes;
  /// null: the default stream.
  CUstream_st* stream = nullptr;
  std::shared_ptr<DeviceMemory> memory = {};  ///< null: a pool that keeps what meshes give back
};

/// Samples in the memory of a CUDA device. Owns nothing: they must stay as they are until the work
/// that reads them is over.
struct DeviceArray {
  const void* samples = nullptr;  ///< sample (0, 0, 0), aligned as its type; the device's memory
  ScalarType type = ScalarType::f32;  ///< of the samples
  Int3 extent = {};                   ///< samples along x, y, z
  /// Bytes from a sample to the next one along x, y, z, multiples of a sample, which may be
  /// negative. All 0: without gaps, x fastest, which is C order of an array [z, y, x]. That along
  /// an axis of one sample is ignored; along others 0 is refused.
  Int3 strides = {};
  Transform transform = {};  ///< index space to world space
  /// All work and all memory are of this stream (a cudaStream_t), which must outlive the meshes;
  /// null: the default stream. Whatever writes the samples comes before in it.
  CUstream_st* stream = nullptr;
  std::shared_ptr<DeviceMemory> memory = {};  ///< null: a pool that keeps what meshes give back

  /// An array without gaps whose samples are of type T.
  template <class T>
  static DeviceArray of(const T* samples, Int3 extent) {
    DeviceArray array;
    array.samples = samples;
    array.type = scalar_type_of<T>;
    array.extent = extent;
    return array;
  }
};

}  // namespace isobrick
