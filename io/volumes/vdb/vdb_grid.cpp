#include "io/volumes/vdb/vdb_grid.h"

#include <fmt/format.h>

#include <openvdb/io/Archive.h>

#include <ostream>
#include <vector>

#include "core/budget_error.h"
#include "io/bytes/writer_stream.h"
#include "io/volumes/vdb/vdb_header.h"

namespace isobrick::inline v0 {
namespace {

openvdb::math::Transform::Ptr grid_transform(const Transform& t) {
  openvdb::Mat4d m = openvdb::Mat4d::identity();
  for (int axis = 0; axis < 3; ++axis)
    for (int row = 0; row < 3; ++row)
      m(axis, row) = t.direction[static_cast<std::size_t>(3 * row + axis)] * t.spacing[axis];
  for (int row = 0; row < 3; ++row) m(3, row) = t.origin[row];
  return openvdb::math::Transform::createLinearTransform(m);
}

/// OpenVDB's own File has a stream of its own, whose failures it does not look at: a full disk
/// leaves a truncated file and no error.
class GridArchive final : private openvdb::io::Archive {
 public:
  void write_grid(std::ostream& out, const openvdb::GridBase::Ptr& grid) const {
    Archive::write(out, openvdb::GridCPtrVec{grid}, /*seekable=*/true);
  }
};

}  // namespace

void describe_vdb_grid(openvdb::GridBase& grid, const VolumeInfo& info, const std::string& name) {
  grid.setName(name);
  grid.setTransform(grid_transform(info.transform));
  if (!info.transform.unit.empty())
    grid.insertMeta(kVdbUnit, openvdb::StringMetadata(info.transform.unit));
}

void throw_vdb_budget(std::uint64_t budget) {
  throw BudgetError(
      fmt::format("the grid takes more than the {} MiB that the memory budget leaves for it, and "
                  "OpenVDB holds it whole: give more, or export a region or a coarser level",
                  budget >> 20));
}

void write_vdb_grid(OutputFile& file, const openvdb::GridBase::Ptr& grid) {
  try {
    WriterStream stream(file.writer());
    GridArchive().write_grid(stream, grid);
    file.writer().flush();
    const std::vector<VdbGrid> written = read_vdb_header(file.temporary_path());
    if (written.size() != 1 || written[0].end != file.writer().size())
      throw Error(fmt::format("cannot write '{}': OpenVDB left an unfinished file of {} bytes",
                              file.path(), file.writer().size()));
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    throw Error(fmt::format("cannot write '{}': {}", file.path(), error.what()));
  }
}

}  // namespace isobrick
