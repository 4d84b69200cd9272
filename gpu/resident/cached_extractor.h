#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include <isobrick/device_volume.h>

namespace isobrick::inline v0::gpu {

/// Isosurfaces of a volume on a device, and an extractor for the options of the last surface.
/// Leaves the calling thread's current device as it was. Not thread-safe.
class CachedExtractor {
 public:
  /// Of an array. Strides are given, multiples of a sample. Throws UsageError for samples that are
  /// not in a device's memory.
  explicit CachedExtractor(const DeviceArray& array);
  /// Of the tiles that are loaded to a device.
  CachedExtractor(int device, const Transform& transform, std::unique_ptr<DeviceVolume> volume,
                  bool may_have_nan);
  ~CachedExtractor();

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
  std::unique_ptr<DeviceVolume> volume_;
  bool may_have_nan_;
  SurfaceOptions options_;       ///< of the extractor
  std::uint64_t max_bytes_ = 0;  ///< likewise
  std::optional<ResidentExtractor> extractor_;
  std::uint64_t begun_ = 0;
  bool is_finished_ = true;
};

}  // namespace isobrick::gpu
