#include "isobrick/volumes/vdb_grid.h"

#include <fmt/format.h>

#include "isobrick/core/error.h"

namespace isobrick {
namespace {

openvdb::math::Transform::Ptr grid_transform(const Transform& t) {
  openvdb::Mat4d m = openvdb::Mat4d::identity();
  for (int axis = 0; axis < 3; ++axis)
    for (int row = 0; row < 3; ++row)
      m(axis, row) = t.direction[static_cast<std::size_t>(3 * row + axis)] * t.spacing[axis];
  for (int row = 0; row < 3; ++row) m(3, row) = t.origin[row];
  return openvdb::math::Transform::createLinearTransform(m);
}

}  // namespace

void describe_vdb_grid(openvdb::GridBase& grid, const VolumeInfo& info, const std::string& name) {
  grid.setName(name);
  grid.setTransform(grid_transform(info.transform));
  if (!info.transform.unit.empty())
    grid.insertMeta(kVdbUnit, openvdb::StringMetadata(info.transform.unit));
}

void throw_vdb_budget(std::uint64_t budget) {
  throw UsageError(
      fmt::format("the grid takes more than the {} MiB that the memory budget leaves for it, and "
                  "OpenVDB holds it whole: give more, or export a region or a coarser level",
                  budget >> 20));
}

void write_vdb_grid(const std::string& path, const openvdb::GridBase::Ptr& grid) {
  try {
    openvdb::io::File file(path);
    file.write({grid});
  } catch (const std::exception& error) {
    throw Error(fmt::format("cannot write '{}': {}", path, error.what()));
  }
}

}  // namespace isobrick
