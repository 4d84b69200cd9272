#include "gpu/resident/cached_extractor.h"

#include <fmt/format.h>

#include <utility>

#include "core/length_unit.h"
#include "gpu/memory/cuda_check.h"
#include "gpu/memory/device_scope.h"

namespace isobrick::inline v0::gpu {
namespace {

int device_of(const void* samples) {
  cudaPointerAttributes attributes{};
  check(cudaPointerGetAttributes(&attributes, samples));
  if (attributes.type != cudaMemoryTypeDevice && attributes.type != cudaMemoryTypeManaged)
    throw UsageError("the samples are not in the memory of a CUDA device");
  return attributes.device;
}

/// Whether one extractor makes both; they are of one volume.
bool are_alike(const SurfaceOptions& a, const SurfaceOptions& b) {
  return a.inside == b.inside && a.normals == b.normals && a.drop_degenerate == b.drop_degenerate &&
         a.topology == b.topology && a.cap == b.cap && a.roi == b.roi;
}

}  // namespace

CachedExtractor::CachedExtractor(const DeviceArray& array)
    : device_(device_of(array.samples)), transform_(array.transform) {
  const DeviceScope scope(device_);
  volume_ = std::make_unique<DeviceVolume>(array);
  may_have_nan_ = volume_->has_nan();
}

CachedExtractor::CachedExtractor(int device, const Transform& transform,
                                 std::unique_ptr<DeviceVolume> volume, bool may_have_nan)
    : device_(device),
      transform_(transform),
      volume_(std::move(volume)),
      may_have_nan_(may_have_nan) {}

CachedExtractor::~CachedExtractor() {
  const DeviceScope scope(device_);
  extractor_.reset();
  volume_.reset();
}

std::uint64_t CachedExtractor::begin(SurfaceOptions options, std::uint64_t max_bytes) {
  const DeviceScope scope(device_);
  if (volume_->bytes() > max_bytes)
    throw UsageError(fmt::format(
        "--gpu-memory is too small: samples and ranges alone take {} bytes", volume_->bytes()));
  options.transform = transform_;
  options.may_have_nan = may_have_nan_;
  if (!extractor_ || max_bytes != max_bytes_ || !are_alike(options, options_)) {
    extractor_.reset();
    extractor_.emplace(*volume_, options, ResidentTuning{}, max_bytes - volume_->bytes());
    options_ = options;
    max_bytes_ = max_bytes;
  }
  is_finished_ = true;
  extractor_->begin(options.isovalue);
  is_finished_ = false;
  return ++begun_;
}

bool CachedExtractor::is_over(std::uint64_t number) const {
  return number != begun_ || is_finished_ || extractor_->is_over();
}

DeviceMesh CachedExtractor::finish(std::uint64_t number) {
  if (number != begun_ || is_finished_)
    throw UsageError("this mesh is taken already, or its extractor has begun another");
  const DeviceScope scope(device_);
  is_finished_ = true;
  extractor_->finish();
  return extractor_->take_mesh(unit_name(transform_.unit));
}

}  // namespace isobrick::gpu
