#include "io/volumes/selected_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include <isobrick/lattice.h>
#include "core/wide_type.h"

namespace isobrick::inline v0 {
namespace {

constexpr Int3 kEach{1, 1, 1};

/// Every n-th sample of a box of a volume.
class SubsampledSource final : public VolumeSource {
 public:
  SubsampledSource(std::unique_ptr<VolumeSource> whole, Box3 box, Int3 stride)
      : whole_(std::move(whole)), box_(box), stride_(stride), info_(whole_->info()) {
    info_.extent = ceil_div(box.extent(), stride);
    const Vec3d corner{static_cast<double>(box.lo.x), static_cast<double>(box.lo.y),
                       static_cast<double>(box.lo.z)};
    info_.transform.origin = info_.transform.apply(corner);
    for (int axis = 0; axis < 3; ++axis)
      info_.transform.spacing[axis] *= static_cast<double>(stride[axis]);
    if (!copies_directly()) plane_.resize(plane_bytes());
  }

  const VolumeInfo& info() const override { return info_; }
  bool random_access() const override { return whole_->random_access(); }
  bool parallel() const override { return copies_directly() && whole_->parallel(); }
  std::size_t memory() const override { return whole_->memory() + plane_.size(); }
  bool sparse() const override { return whole_->sparse(); }
  bool is_fill(Box3 box) const override { return whole_->is_fill(in_whole(box)); }
  std::optional<std::uint64_t> constant(Box3 box) const override {
    return whole_->constant(in_whole(box));
  }
  std::vector<std::string> notes() const override { return whole_->notes(); }
  void will_need(Box3 box) override { whole_->will_need(in_whole(box)); }

  void read(Box3 box, std::byte* out) override {
    if (copies_directly()) return whole_->read(in_whole(box), out);
    const std::size_t bytes =
        static_cast<std::size_t>(box.extent().x * box.extent().y) * size_of(info_.type);
    for (Box3 plane = box; plane.lo.z < box.hi.z; ++plane.lo.z, out += bytes) {
      plane.hi.z = plane.lo.z + 1;
      read_plane(plane, out);
    }
  }

 private:
  /// Whether a box of samples is a box of the whole volume, which gives any.
  bool copies_directly() const { return stride_ == kEach && whole_->random_access(); }
  /// Of a plane that is read: streams give whole ones only.
  std::size_t plane_bytes() const {
    const Int3 extent = whole_->random_access() ? box_.extent() : whole_->info().extent;
    return static_cast<std::size_t>(extent.x * extent.y) * size_of(info_.type);
  }
  /// The smallest box of the whole volume that has the samples of `box`.
  Box3 in_whole(Box3 box) const {
    return {box_.lo + box.lo * stride_, box_.lo + (box.hi - kEach) * stride_ + kEach};
  }

  void read_plane(Box3 plane, std::byte* out) {
    Box3 from = in_whole(plane);
    const Box3 wanted = from;
    if (!whole_->random_access()) {
      const Int3 extent = whole_->info().extent;
      from = {{0, 0, from.lo.z}, {extent.x, extent.y, from.hi.z}};
      // A stream is read up to its first plane that is wanted.
      for (; next_plane_ < from.lo.z; ++next_plane_)
        whole_->read({{0, 0, next_plane_}, {extent.x, extent.y, next_plane_ + 1}}, plane_.data());
      next_plane_ = from.hi.z;
    }
    whole_->read(from, plane_.data());
    visit_sample(info_.type, [&](auto tag) {
      using T = typename decltype(tag)::type;
      for (Index y = wanted.lo.y; y < wanted.hi.y; y += stride_.y) {
        const std::byte* row =
            plane_.data() +
            sizeof(T) * static_cast<std::size_t>(linear_index(
                            {wanted.lo.x - from.lo.x, y - from.lo.y, 0}, from.extent()));
        for (Index x = wanted.lo.x; x < wanted.hi.x; x += stride_.x, out += sizeof(T))
          std::memcpy(out, row + sizeof(T) * static_cast<std::size_t>(x - wanted.lo.x), sizeof(T));
      }
    });
  }

  std::unique_ptr<VolumeSource> whole_;
  Box3 box_;
  Int3 stride_;
  VolumeInfo info_;
  std::vector<std::byte> plane_;
  Index next_plane_ = 0;  ///< of a stream
};

/// A volume where samples of one value are missing.
class NodataSource final : public VolumeSource {
 public:
  NodataSource(std::unique_ptr<VolumeSource> stored, double nodata)
      : stored_(std::move(stored)),
        nodata_(as_sample(nodata, stored_->info().type)),
        info_(stored_->info()) {
    info_.type = type_with_nan(info_.type);
    if (info_.fill_value == nodata_) info_.fill_value = std::numeric_limits<double>::quiet_NaN();
  }

  const VolumeInfo& info() const override { return info_; }
  bool random_access() const override { return stored_->random_access(); }
  bool parallel() const override { return stored_->parallel(); }
  std::size_t memory() const override { return stored_->memory(); }
  bool sparse() const override { return stored_->sparse(); }
  bool is_fill(Box3 box) const override { return stored_->is_fill(box); }
  std::vector<std::string> notes() const override { return stored_->notes(); }
  void will_need(Box3 box) override { stored_->will_need(box); }

  void read(Box3 box, std::byte* out) override {
    const ScalarType type = stored_->info().type;
    const auto count = static_cast<std::size_t>(volume(box.extent()));
    // Stored samples are the last ones of the room, so that none is overwritten before it is read.
    const std::byte* from = out + count * (size_of(info_.type) - size_of(type));
    stored_->read(box, out + count * (size_of(info_.type) - size_of(type)));
    visit_sample(type, [&](auto tag) {
      using From = typename decltype(tag)::type;
      constexpr ScalarType to = type_with_nan(scalar_type_of<From>);
      using To = std::conditional_t<to == ScalarType::f64, double, float>;
      for (std::size_t i = 0; i < count; ++i) {
        From value;
        std::memcpy(&value, from + i * sizeof(From), sizeof(From));
        To real = static_cast<To>(value);
        if constexpr (std::is_integral_v<From> && sizeof(From) == 8) real = exact_double(value);
        if (static_cast<double>(value) == nodata_) real = std::numeric_limits<To>::quiet_NaN();
        std::memcpy(out + i * sizeof(To), &real, sizeof(To));
      }
    });
  }

 private:
  std::unique_ptr<VolumeSource> stored_;
  double nodata_;
  VolumeInfo info_;
};

void check_stride(Int3 stride) {
  for (int axis = 0; axis < 3; ++axis)
    if (stride[axis] < 1)
      throw UsageError(fmt::format("a stride of {} along {} is none; it is at least 1",
                                   stride[axis], "xyz"[axis]));
}

}  // namespace

std::unique_ptr<VolumeSource> select_samples(std::unique_ptr<VolumeSource> source,
                                             const VolumeRequest& request) {
  check_stride(request.stride);
  // Regions are of what a stride leaves, as they are of the samples of a store.
  const Int3 extent = ceil_div(source->info().extent, request.stride);
  Transform transform = source->info().transform;
  for (int axis = 0; axis < 3; ++axis)
    transform.spacing[axis] *= static_cast<double>(request.stride[axis]);
  const Box3 whole{{0, 0, 0}, extent};
  Box3 box = request.roi ? resolve_region(*request.roi, extent) : whole;
  if (request.region) {
    const Box3 covering = covering_samples(*request.region, transform, extent);
    const Box3 both = intersect(box, covering);
    if (both.empty())
      throw UsageError("the region in samples and the region in world space do not meet");
    box = both;
  }
  if (!(box == whole) || !(request.stride == kEach))
    source = std::make_unique<SubsampledSource>(
        std::move(source), Box3{box.lo * request.stride, (box.hi - kEach) * request.stride + kEach},
        request.stride);
  if (request.nodata) source = std::make_unique<NodataSource>(std::move(source), *request.nodata);
  return source;
}

}  // namespace isobrick
