#include <isobrick/volume_request.h>

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include <isobrick/error.h>
#include <isobrick/lattice.h>
#include "core/length_unit.h"

namespace isobrick {
namespace {

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
  if (name.empty())
    throw UsageError(
        fmt::format("--unit: '{}' is no unit of length; it is one of {}", unit, unit_names()));
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
  if (request.grid || request.region)
    throw UsageError(fmt::format("'{}' is no OpenVDB file: leave {} out", path,
                                 request.grid ? "--grid" : "--roi"));
}

void refuse_selection(const std::string& path, const VolumeRequest& request) {
  choose(path, "--channel", 1, request.selection.channel);
  choose(path, "--time", 1, request.selection.time);
}

}  // namespace isobrick
