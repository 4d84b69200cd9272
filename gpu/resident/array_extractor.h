#pragma once

#include <cstdint>
#include <optional>

#include <isobrick/device_volume.h>

namespace isobrick::inline v0::gpu {

/// Isosurfaces of an array: a volume of it, and an extractor for the options of the last surface.
/// Leaves the calling thread's current device as it was. Not thread-safe.
class ArrayExtractor {
 public:
  /// Strides are given, multiples of a sample. Throws UsageError for samples that are not in a
  /// device's memory.
  explicit ArrayExtractor(const DeviceArray& array);
  ~ArrayExtractor();

  const Lattice& lattice() const { return volume_->lattice(); }
  const Transform& transform() const { return transform_; }

  /// Begins a surface; the number by which finish() knows it. Takes at most `max_bytes` of device
  /// memory, that of the samples included.
  std::uint64_t begin(SurfaceOptions options, std::uint64_t max_bytes);
  /// Whether finish() has nothing to wait for.
  bool is_over(std::uint64_t number) const;
  /// Throws UsageError where another surface was begun meanwhile, or this one is finished.
  DeviceMesh finish(std::uint64_t number);

 private:
  int device_;
  Transform transform_;
  std::optional<DeviceVolume> volume_;
  SurfaceOptions options_;       ///< of the extractor
  std::uint64_t max_bytes_ = 0;  ///< likewise
  std::optional<ResidentExtractor> extractor_;
  std::uint64_t begun_ = 0;
  bool is_finished_ = true;
};

}  // namespace isobrick::gpu
