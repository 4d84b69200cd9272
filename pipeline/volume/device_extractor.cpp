#include <isobrick/device_extractor.h>

#include <fmt/format.h>

#include <limits>
#include <utility>

#include <isobrick/error.h>
#include "gpu/resident/array_extractor.h"
#include "pipeline/extract/mesh_header.h"
#include "pipeline/volume/volume_samples.h"

namespace isobrick::inline v0 {
namespace {

DeviceArray checked(DeviceArray array) {
  check_extent(array.extent);
  if (!array.samples) throw UsageError("the array has no samples");
  const auto bytes = static_cast<Index>(size_of(array.type));
  array.strides = resolve_strides(array.strides, array.extent, bytes, "samples");
  for (int axis = 0; axis < 3; ++axis)
    if (array.strides[axis] % bytes != 0 && array.extent[axis] > 1)
      throw UsageError(fmt::format("the stride along {} is no multiple of a sample's {} bytes",
                                   "xyz"[axis], bytes));
  if (reinterpret_cast<std::uintptr_t>(array.samples) % static_cast<std::uintptr_t>(bytes) != 0)
    throw UsageError("the samples are not aligned as their type");
  check_transform(array.transform, array.extent, "the array");
  return array;
}

SurfaceOptions surface_of(const ExtractOptions& options, const Lattice& lattice) {
  if (options.level != 0) throw UsageError(fmt::format("an array has no level {}", options.level));
  if (options.backend == Backend::cpu)
    throw UsageError("samples in device memory are extracted on the GPU");
  const Box3 roi = options.roi.value_or(lattice.box());
  check_roi(roi, lattice.extent);
  return {.isovalue = options.isovalue,
          .inside = options.inside.value_or(Inside::above),
          .normals = options.normals,
          .drop_degenerate = options.drop_degenerate,
          .topology = options.topology,
          .cap = options.cap,
          .roi = roi};
}

}  // namespace

struct DeviceExtractor::Impl {
  gpu::ArrayExtractor extractor;

  explicit Impl(const DeviceArray& array) : extractor(checked(array)) {}

  std::uint64_t begin(const ExtractOptions& options) {
    return extractor.begin(
        surface_of(options, extractor.lattice()),
        options.gpu_memory > 0 ? options.gpu_memory : std::numeric_limits<std::uint64_t>::max());
  }
};

/// Keeps what it needs of the extractor.
struct PendingDeviceMesh::Impl {
  std::shared_ptr<DeviceExtractor::Impl> of;
  std::uint64_t number;

  Impl(std::shared_ptr<DeviceExtractor::Impl> extractor, std::uint64_t n)
      : of(std::move(extractor)), number(n) {}
};

PendingDeviceMesh::PendingDeviceMesh(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
PendingDeviceMesh::~PendingDeviceMesh() = default;
PendingDeviceMesh::PendingDeviceMesh(PendingDeviceMesh&&) noexcept = default;

bool PendingDeviceMesh::is_ready() const { return impl_->of->extractor.is_over(impl_->number); }
DeviceMesh PendingDeviceMesh::get() { return impl_->of->extractor.finish(impl_->number); }

DeviceExtractor::DeviceExtractor(const DeviceArray& array) : impl_(std::make_shared<Impl>(array)) {}
DeviceExtractor::~DeviceExtractor() = default;
DeviceExtractor::DeviceExtractor(DeviceExtractor&&) noexcept = default;

DeviceMesh DeviceExtractor::extract(const ExtractOptions& options) {
  return impl_->extractor.finish(impl_->begin(options));
}

PendingDeviceMesh DeviceExtractor::extract_async(const ExtractOptions& options) {
  return PendingDeviceMesh(std::make_unique<PendingDeviceMesh::Impl>(impl_, impl_->begin(options)));
}

DeviceMesh extract(const DeviceArray& array, const ExtractOptions& options) {
  return DeviceExtractor(array).extract(options);
}

}  // namespace isobrick
