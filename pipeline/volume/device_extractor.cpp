#include <isobrick/device_extractor.h>

#include <fmt/format.h>

#include <limits>
#include <utility>

#include <isobrick/error.h>
#include "pipeline/extract/mesh_header.h"
#include "pipeline/volume/store_on_device.h"
#include "pipeline/volume/volume_samples.h"

namespace isobrick::inline v0 {
namespace {

DeviceArray checked(DeviceArray array) {
  check_extent(array.extent);
  if (!array.samples) throw UsageError("the array has no samples");
  if (is_wide_integer(array.type))
    throw UsageError("surfaces of 64-bit integers on a device are not made; make them float64");
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

/// What surfaces may be made of.
struct SamplesOnDevice {
  Box3 region;
  int level = 0;
  Inside inside = Inside::above;
  bool are_of_store = false;

  SurfaceOptions surface(const ExtractOptions& options, const Lattice& lattice) const {
    check_level(options.level);
    if (options.backend == Backend::cpu)
      throw UsageError("samples in device memory are extracted on the GPU");
    const Box3 roi = options.roi.value_or(region);
    check_roi(roi, lattice.extent);
    if (intersect(roi, region) != roi)
      throw UsageError("the region reaches beyond the one that was read to the device");
    return {.isovalue = options.isovalue,
            .inside = options.inside.value_or(inside),
            .normals = options.normals,
            .drop_degenerate = options.drop_degenerate,
            .topology = options.topology,
            .cap = options.cap,
            .roi = roi};
  }

 private:
  void check_level(int wanted) const {
    if (wanted == level) return;
    if (!are_of_store) throw UsageError(fmt::format("an array has no level {}", wanted));
    throw UsageError(fmt::format("level {} was read to the device, not level {}", level, wanted));
  }
};

}  // namespace

struct DeviceExtractor::Impl {
  std::unique_ptr<gpu::CachedExtractor> extractor;
  SamplesOnDevice samples;

  explicit Impl(const DeviceArray& array)
      : extractor(std::make_unique<gpu::CachedExtractor>(checked(array))),
        samples{extractor->lattice().box()} {}
  Impl(StoreOnDevice store, int level)
      : extractor(std::move(store.extractor)), samples{store.region, level, store.inside, true} {}

  std::uint64_t begin(const ExtractOptions& options) {
    return extractor->begin(
        samples.surface(options, extractor->lattice()),
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

bool PendingDeviceMesh::is_ready() const { return impl_->of->extractor->is_over(impl_->number); }
DeviceMesh PendingDeviceMesh::get() { return impl_->of->extractor->finish(impl_->number); }

DeviceExtractor::DeviceExtractor(const DeviceArray& array) : impl_(std::make_shared<Impl>(array)) {}
DeviceExtractor::DeviceExtractor(const StoreReader& store, const ExtractOptions& options,
                                 const DeviceTarget& target, Progress& progress)
    : impl_(std::make_shared<Impl>(
          load_to_device(store, options, target, LoadedPart::all, progress), options.level)) {}
DeviceExtractor::~DeviceExtractor() = default;
DeviceExtractor::DeviceExtractor(DeviceExtractor&&) noexcept = default;

DeviceMesh DeviceExtractor::extract(const ExtractOptions& options) {
  return impl_->extractor->finish(impl_->begin(options));
}

PendingDeviceMesh DeviceExtractor::extract_async(const ExtractOptions& options) {
  return PendingDeviceMesh(std::make_unique<PendingDeviceMesh::Impl>(impl_, impl_->begin(options)));
}

DeviceMesh extract(const DeviceArray& array, const ExtractOptions& options) {
  return DeviceExtractor(array).extract(options);
}

DeviceMesh extract_to_device(const StoreReader& store, const ExtractOptions& options,
                             const DeviceTarget& target, Progress& progress) {
  DeviceExtractor::Impl impl(load_to_device(store, options, target, LoadedPart::isovalue, progress),
                             options.level);
  return impl.extractor->finish(impl.begin(options));
}

}  // namespace isobrick
