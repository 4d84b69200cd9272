#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>

#include <isobrick/scalar.h>
#include <isobrick/transform.h>
#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// Samples of the caller's, in memory or behind a function. Owns nothing: memory and what the
/// function uses must stay as they are while the volume is used.
struct Volume {
  /// Sample (0, 0, 0), of any alignment; null: `read` gives the samples.
  const void* samples = nullptr;
  ScalarType type = ScalarType::f32;  ///< of the samples, in native byte order
  Int3 extent = {};                   ///< samples along x, y, z
  /// Bytes from a sample to the next one along x, y, z, which may be negative. All 0: without gaps,
  /// x fastest, which is C order of an array [z, y, x]. That along an axis of one sample is
  /// ignored; along others 0 is refused.
  Int3 strides = {};
  Transform transform = {};            ///< index space to world space
  std::optional<double> nodata = {};   ///< samples of this value are missing
  const std::uint8_t* mask = nullptr;  ///< where it is 0 the sample is missing; null: none is
  Int3 mask_strides = {};              ///< of the mask, as `strides`
  /// In place of `samples`: copies those of a box, which lies in the extent, to `out`, C order
  /// [z, y, x] without gaps. Called from one thread at a time, which need not be the caller's, or
  /// from several where `concurrent_reads` is set. What it throws ends the operation. With a region
  /// it is asked for whole boxes; what it gives beyond the region and a layer around it, two with
  /// normals, does not show in that surface.
  std::function<void(Box3 box, void* out)> read = {};
  bool concurrent_reads = false;  ///< whether several threads may call `read` at a time

  /// A volume without gaps whose samples are of type T.
  template <class T>
  static Volume of(const T* samples, Int3 extent) {
    Volume volume;
    volume.samples = samples;
    volume.type = scalar_type_of<T>;
    volume.extent = extent;
    return volume;
  }
};

}  // namespace isobrick
