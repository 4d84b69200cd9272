#include <isobrick/volume_request.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <isobrick/error.h>
#include <isobrick/lattice.h>
#include "core/length_unit.h"
#include "core/vectors.h"

namespace isobrick::inline v0 {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

void check_geometry(const VolumeInfo& info) {
  const Int3 e = info.extent;
  if (e.x <= 0 || e.y <= 0 || e.z <= 0)
    throw UsageError(
        fmt::format("'{}': the extent {}x{}x{} is not positive", info.name, e.x, e.y, e.z));
  if (!checked_volume(e))
    throw UsageError(fmt::format("'{}': a volume of {}x{}x{} samples is too large to address",
                                 info.name, e.x, e.y, e.z));
  for (int i = 0; i < 3; ++i)
    if (!std::isfinite(info.transform.spacing[i]) || info.transform.spacing[i] <= 0 ||
        !std::isfinite(info.transform.origin[i]))
      throw UsageError(
          fmt::format("'{}': spacing must be positive and finite, the origin finite", info.name));
}

std::string checked_unit(const std::string& unit) {
  std::string name = unit_name(unit);
  if (name.empty()) throw UsageError("--unit: " + no_unit_text(unit));
  return name;
}

}  // namespace

VolumeInfo describe_volume(const std::string& path, Int3 extent, ScalarType type,
                           Transform transform, const VolumeRequest& request) {
  VolumeInfo info;
  info.extent = extent;
  info.type = type;
  info.transform = std::move(transform);
  info.name = path;
  info.files = {path};
  if (request.spacing) info.transform.spacing = *request.spacing;
  if (request.origin) info.transform.origin = *request.origin;
  // What is no length ("pixel") is left out: viewers refuse a store with it.
  info.transform.unit = request.unit ? checked_unit(*request.unit) : unit_name(info.transform.unit);
  check_geometry(info);
  return info;
}

void refuse_raw_description(const std::string& path, std::string_view format,
                            const VolumeRequest& request) {
  const char* option = request.extent   ? "--dims"
                       : request.type   ? "--type"
                       : request.order  ? "--endian"
                       : request.offset ? "--offset"
                                        : nullptr;
  if (option)
    throw UsageError(
        fmt::format("'{}' is {}, which itself states what --dims, --type, --endian and "
                    "--offset are for: leave {} out",
                    path, format, option));
}

void refuse_grid(const std::string& path, const VolumeRequest& request) {
  if (request.grid || request.bounds)
    throw UsageError(fmt::format("'{}' is no OpenVDB file: leave {} out", path,
                                 request.grid ? "--grid" : "--bounds"));
}

Box3 resolve_region(const RegionRequest& region, Int3 extent) {
  Box3 box{{0, 0, 0}, extent};
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    box.lo[axis] = region.lo[i].value_or(0);
    box.hi[axis] = region.hi[i].value_or(extent[axis]);
    if (box.lo[axis] < 0 || box.lo[axis] >= box.hi[axis] || box.hi[axis] > extent[axis])
      throw UsageError(
          fmt::format("the region {}:{} along {} is empty or leaves the volume, which "
                      "has samples 0:{} there",
                      box.lo[axis], box.hi[axis], "xyz"[axis], extent[axis]));
  }
  return box;
}

std::array<Vec3d, 2> index_bounds(const WorldRegion& region, const Transform& transform) {
  Vec3d lo{kInfinity, kInfinity, kInfinity}, hi = lo * -1.0;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3d p{(corner & 1 ? region.hi : region.lo).x, (corner & 2 ? region.hi : region.lo).y,
                  (corner & 4 ? region.hi : region.lo).z};
    const Vec3d at = transform.index_of(p);
    for (int axis = 0; axis < 3; ++axis) {
      lo[axis] = std::min(lo[axis], at[axis]);
      hi[axis] = std::max(hi[axis], at[axis]);
    }
  }
  return {lo, hi};
}

Box3 covering_samples(const WorldRegion& region, const Transform& transform, Int3 extent) {
  // A bound at a sample means that sample, however it was rounded.
  constexpr double rounding = 1e-6;
  const auto [lo, hi] = index_bounds(region, transform);
  Box3 box;
  for (int axis = 0; axis < 3; ++axis) {
    const auto last = static_cast<double>(extent[axis] - 1);
    if (!(lo[axis] <= last && hi[axis] >= 0)) {
      const Vec3d end = transform.apply({static_cast<double>(extent.x - 1),
                                         static_cast<double>(extent.y - 1),
                                         static_cast<double>(extent.z - 1)}),
                  from = transform.origin;
      throw UsageError(fmt::format(
          "the region {}:{},{}:{},{}:{} does not touch the volume, which reaches from ({}, {}, {}) "
          "to ({}, {}, {}) in world space",
          region.lo.x, region.hi.x, region.lo.y, region.hi.y, region.lo.z, region.hi.z, from.x,
          from.y, from.z, end.x, end.y, end.z));
    }
    box.lo[axis] = static_cast<Index>(std::floor(std::clamp(lo[axis] + rounding, 0.0, last)));
    box.hi[axis] = static_cast<Index>(std::ceil(std::clamp(hi[axis] - rounding, 0.0, last))) + 1;
  }
  return box;
}

void refuse_selection(const std::string& path, const VolumeRequest& request) {
  choose(path, "--channel", 1, request.selection.channel);
  choose(path, "--time", 1, request.selection.time);
}

}  // namespace isobrick
