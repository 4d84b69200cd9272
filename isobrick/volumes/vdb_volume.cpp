#include "isobrick/volumes/vdb_volume.h"

#include <fmt/format.h>
#include <openvdb/openvdb.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>
#include <utility>

#include "isobrick/core/error.h"
#include "isobrick/volumes/text_header.h"
#include "isobrick/volumes/vdb_archive.h"
#include "isobrick/volumes/vdb_grid.h"
#include "isobrick/volumes/vdb_header.h"
#include "isobrick/volumes/vdb_tree.h"

namespace isobrick {
namespace {

constexpr std::size_t kMiB = std::size_t{1} << 20;

template <class Tree, class Out>
class VdbSource final : public VolumeSource {
 public:
  VdbSource(VolumeInfo info, typename Tree::ConstPtr tree, Int3 corner)
      : info_(std::move(info)), tree_(std::move(tree)), corner_(corner) {}

  const VolumeInfo& info() const override { return info_; }
  bool random_access() const override { return true; }
  bool sparse() const override { return true; }
  std::size_t memory() const override { return tree_->memUsage(); }

  bool is_fill(Box3 box) const override { return box_is_background(*tree_, coordinates(box)); }
  void read(Box3 box, std::byte* out) override {
    if (!box.empty()) read_tree(*tree_, coordinates(box), reinterpret_cast<Out*>(out));
  }

 private:
  openvdb::CoordBBox coordinates(Box3 box) const {
    const auto at = [&](Int3 p) {
      return openvdb::Coord(static_cast<int>(corner_.x + p.x), static_cast<int>(corner_.y + p.y),
                            static_cast<int>(corner_.z + p.z));
    };
    return {at(box.lo), at(box.hi - Int3{1, 1, 1})};
  }

  VolumeInfo info_;
  typename Tree::ConstPtr tree_;
  Int3 corner_;  ///< of the volume, in the grid's index coordinates
};

/// Samples are where the grid's transform puts its integer coordinates, whether
/// its writer takes them for the corners or the centres of voxels.
Transform transform_of(const std::string& path, const openvdb::math::Transform& grid, Int3 corner) {
  const auto affine = grid.baseMap()->getAffineMap();
  const openvdb::Mat4d m = affine->getMat4();
  Transform transform;
  Vec3d axes[3];
  for (int axis = 0; axis < 3; ++axis)
    for (int row = 0; row < 3; ++row) axes[axis][row] = m(axis, row);
  set_axes(path, transform, axes);
  for (int row = 0; row < 3; ++row)
    transform.origin[row] = m(3, row) + m(0, row) * static_cast<double>(corner.x) +
                            m(1, row) * static_cast<double>(corner.y) +
                            m(2, row) * static_cast<double>(corner.z);
  return transform;
}

/// Where to cut the grid, in its own coordinates.
Box3 region_of(const VdbGrid& grid, const std::string& path, const openvdb::GridBase& read,
               const std::optional<RegionRequest>& asked) {
  Box3 box;
  const openvdb::CoordBBox active = read.evalActiveVoxelBoundingBox();
  const bool none = active.empty();
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    const auto lo = asked ? asked->lo[i] : std::nullopt, hi = asked ? asked->hi[i] : std::nullopt;
    if (none && (!lo || !hi))
      throw UsageError(
          fmt::format("'{}': grid '{}' has no active voxels: say with --roi what is wanted of it",
                      path, grid.name));
    box.lo[axis] = lo.value_or(active.min()[axis]);
    box.hi[axis] = hi.value_or(Index{active.max()[axis]} + 1);
    if (box.lo[axis] < std::numeric_limits<int>::min() ||
        box.hi[axis] > Index{std::numeric_limits<int>::max()} + 1 || box.lo[axis] >= box.hi[axis])
      throw UsageError(
          fmt::format("'{}': the region {}:{} along {} is empty or leaves the "
                      "coordinates of a grid",
                      path, box.lo[axis], box.hi[axis], "xyz"[axis]));
  }
  return box;
}

/// The type that holds every value of a grid of 64-bit integers exactly.
ScalarType type_of_int64(const std::string& path, const VdbGrid& grid,
                         const openvdb::Int64Tree& tree) {
  const auto [lo, hi] = value_range(tree);
  if (lo >= std::numeric_limits<std::int32_t>::min() &&
      hi <= std::numeric_limits<std::int32_t>::max())
    return ScalarType::i32;
  if (lo >= 0 && hi <= std::numeric_limits<std::uint32_t>::max()) return ScalarType::u32;
  constexpr std::int64_t exact = std::int64_t{1} << 53;
  if (lo >= -exact && hi <= exact) return ScalarType::f64;
  throw UsageError(
      fmt::format("'{}': grid '{}' has values from {} to {}, which no sample type holds exactly",
                  path, grid.name, lo, hi));
}

struct Opening {
  const std::string& path;
  const VolumeRequest& said;
  const VdbGrid& grid;
  openvdb::GridBase::Ptr read;
};

template <class Out, class Tree>
std::unique_ptr<VolumeSource> make_source(const Opening& in, typename Tree::ConstPtr tree) {
  const Box3 box = region_of(in.grid, in.path, *in.read, in.said.region);
  Transform transform = transform_of(in.path, in.read->transform(), box.lo);
  if (const auto unit = in.read->template getMetadata<openvdb::StringMetadata>(kVdbUnit))
    transform.unit = unit->value();
  VolumeInfo info = describe_volume(in.path, box.extent(), scalar_type_of<Out>, transform, in.said);
  info.fill_value = static_cast<double>(tree->background());
  info.grid_class = in.grid.grid_class;
  info.grid_name = in.read->getName();
  return std::make_unique<VdbSource<Tree, Out>>(std::move(info), std::move(tree), box.lo);
}

template <class Grid, class Out>
std::unique_ptr<VolumeSource> try_type(const Opening& in) {
  const auto grid = openvdb::gridPtrCast<Grid>(in.read);
  return grid ? make_source<Out, typename Grid::TreeType>(in, grid->constTreePtr()) : nullptr;
}

std::unique_ptr<VolumeSource> try_int64(const Opening& in) {
  using Tree = openvdb::Int64Tree;
  const auto grid = openvdb::gridPtrCast<openvdb::Int64Grid>(in.read);
  if (!grid) return nullptr;
  switch (type_of_int64(in.path, in.grid, grid->tree())) {
    case ScalarType::i32: return make_source<std::int32_t, Tree>(in, grid->constTreePtr());
    case ScalarType::u32: return make_source<std::uint32_t, Tree>(in, grid->constTreePtr());
    default: return make_source<double, Tree>(in, grid->constTreePtr());
  }
}

void check_memory(const std::string& path, const VdbGrid& grid, std::uint64_t needed,
                  const std::optional<std::uint64_t>& room) {
  if (room && needed > *room)
    throw UsageError(fmt::format(
        "'{}': grid '{}' takes {} MiB in memory, more than the budget of {} MiB leaves: say "
        "--memory {}M",
        path, grid.name, needed / kMiB + 1, *room / kMiB, needed / kMiB * 5 / 4 + 256));
}

void check_transform(const std::string& path, const VdbGrid& grid) {
  if (grid.map.find("Frustum") != std::string::npos)
    throw UsageError(fmt::format(
        "'{}': grid '{}' has a frustum for its transform ({}), whose voxels are no boxes of one "
        "size; resample it to a linear transform (vdb_tool, Houdini's VDB Resample)",
        path, grid.name, grid.map));
}

}  // namespace

std::unique_ptr<VolumeSource> open_vdb(const std::string& file, const VolumeRequest& said) {
  refuse_raw_description(file, "an OpenVDB file", said);
  refuse_selection(file, said);
  const std::vector<VdbGrid> grids = read_vdb_header(file);
  const VdbGrid& grid =
      choose_vdb_grid(file, grids, said.grid,
                      {"Tree_float_5_4_3", "Tree_double_5_4_3", "Tree_int32_5_4_3",
                       "Tree_int64_5_4_3", "Tree_bool_5_4_3", "Tree_mask_5_4_3"});
  check_transform(file, grid);
  // What the file says of its size in memory, or what its bytes at least become.
  check_memory(file, grid, std::max(grid.memory.value_or(0), grid.end - grid.begin), said.memory);
  const Opening in{file, said, grid, read_vdb_grid(file, grids, grid)};
  check_memory(file, grid, in.read->memUsage(), said.memory);
  std::unique_ptr<VolumeSource> source = try_type<openvdb::FloatGrid, float>(in);
  if (!source) source = try_type<openvdb::DoubleGrid, double>(in);
  if (!source) source = try_type<openvdb::Int32Grid, std::int32_t>(in);
  if (!source) source = try_int64(in);
  if (!source) source = try_type<openvdb::BoolGrid, std::uint8_t>(in);
  if (!source) source = try_type<openvdb::MaskGrid, std::uint8_t>(in);
  if (!source)
    throw Error(fmt::format("'{}': grid '{}' is not of the type it says", file, grid.name));
  return source;
}

}  // namespace isobrick
