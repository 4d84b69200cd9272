#include "io/volumes/vdb/vdb_volume.h"

#include <fmt/format.h>
#include <openvdb/openvdb.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>
#include <utility>

#include <isobrick/error.h>
#include "io/volumes/raw/text_header.h"
#include "io/volumes/vdb/vdb_archive.h"
#include "io/volumes/vdb/vdb_grid.h"
#include "io/volumes/vdb/vdb_half_grid.h"
#include "io/volumes/vdb/vdb_header.h"
#include "io/volumes/vdb/vdb_leaves.h"
#include "io/volumes/vdb/vdb_tree.h"

namespace isobrick::inline v0 {
namespace {

/// `Leaves` knows the values of the tree's leaves: VdbLeaves or VdbLoadedLeaves.
template <class Tree, class Leaves, class Out>
class VdbSource final : public VolumeSource {
 public:
  VdbSource(VolumeInfo info, std::string grid, typename Tree::ConstPtr tree,
            std::shared_ptr<const Leaves> leaves, std::size_t memory, Int3 corner)
      : info_(std::move(info)),
        grid_(std::move(grid)),
        tree_(std::move(tree)),
        leaves_(std::move(leaves)),
        memory_(memory),
        corner_(corner) {}

  const VolumeInfo& info() const override { return info_; }
  bool random_access() const override { return true; }
  bool sparse() const override { return true; }
  std::size_t memory() const override { return memory_; }

  bool is_fill(Box3 box) const override { return box_is_background(*tree_, coordinates(box)); }

  std::optional<std::uint64_t> constant(Box3 box) const override {
    const auto value = constant_value(*tree_, coordinates(box));
    if (!value) return std::nullopt;
    const Out sample = to_sample<Out>(*value);
    std::uint64_t bits = 0;
    std::memcpy(&bits, &sample, sizeof sample);
    return bits;
  }

  void read(Box3 box, std::byte* out) override {
    if (box.empty()) return;
    with_vdb_errors(info_.name, grid_, [&] {
      read_tree(*tree_, typename Leaves::Reader(*leaves_), coordinates(box),
                reinterpret_cast<Out*>(out));
    });
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
  std::string grid_;  ///< its name, for messages
  typename Tree::ConstPtr tree_;
  std::shared_ptr<const Leaves> leaves_;
  std::size_t memory_;
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
Box3 bounds_of(const VdbGrid& grid, const std::string& path, const openvdb::GridBase& read,
               const std::optional<RegionRequest>& bounds) {
  Box3 box;
  const openvdb::CoordBBox active = read.evalActiveVoxelBoundingBox();
  const bool none = active.empty();
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    const auto lo = bounds ? bounds->lo[i] : std::nullopt,
               hi = bounds ? bounds->hi[i] : std::nullopt;
    if (none && (!lo || !hi))
      throw UsageError(fmt::format(
          "'{}': grid '{}' has no active voxels: choose its part with --bounds", path, grid.name));
    box.lo[axis] = lo.value_or(active.min()[static_cast<std::size_t>(axis)]);
    box.hi[axis] = hi.value_or(Index{active.max()[static_cast<std::size_t>(axis)]} + 1);
    if (box.lo[axis] < std::numeric_limits<int>::min() ||
        box.hi[axis] > Index{std::numeric_limits<int>::max()} + 1 || box.lo[axis] >= box.hi[axis])
      throw UsageError(
          fmt::format("'{}': the bounds {}:{} along {} are empty or leave the "
                      "coordinates of a grid",
                      path, box.lo[axis], box.hi[axis], "xyz"[axis]));
  }
  return box;
}

/// The type that holds every number from lo to hi exactly.
ScalarType type_of_int64(const std::string& path, const VdbGrid& grid,
                         std::pair<std::int64_t, std::int64_t> range) {
  const auto [lo, hi] = range;
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

/// A grid to open, and the request for it.
struct GridRequest {
  const std::string& path;
  const VolumeRequest& request;
  const VdbGrid& grid;
  openvdb::GridBase::Ptr read;  ///< without its tree, at first
};

template <class Out, class Tree, class Leaves>
std::unique_ptr<VolumeSource> make_source(const GridRequest& in, typename Tree::ConstPtr tree,
                                          std::shared_ptr<const Leaves> leaves,
                                          std::size_t memory) {
  const Box3 box = bounds_of(in.grid, in.path, *in.read, in.request.bounds);
  Transform transform = transform_of(in.path, in.read->transform(), box.lo);
  if (!in.grid.unit.empty()) transform.unit = in.grid.unit;
  VolumeInfo info =
      describe_volume(in.path, box.extent(), scalar_type_of<Out>, transform, in.request);
  info.fill_value = static_cast<double>(tree->background());
  info.grid_class = in.grid.grid_class;
  info.grid_name = in.grid.own_name;
  return std::make_unique<VdbSource<Tree, Leaves, Out>>(
      std::move(info), in.grid.name, std::move(tree), std::move(leaves), memory, box.lo);
}

/// The same with samples of the type that holds the tree's values.
template <class Tree, class Leaves>
std::unique_ptr<VolumeSource> make_source_of_values(const GridRequest& in,
                                                    typename Tree::ConstPtr tree,
                                                    std::shared_ptr<const Leaves> leaves,
                                                    std::size_t memory) {
  const auto as = [&]<class Out>(Out) {
    return make_source<Out, Tree, Leaves>(in, tree, leaves, memory);
  };
  using Value = typename Tree::ValueType;
  if constexpr (std::is_same_v<Value, bool>) {
    return as(std::uint8_t{});
  } else if constexpr (std::is_same_v<Value, openvdb::math::half>) {
    return as(float{});
  } else if constexpr (!std::is_same_v<Value, std::int64_t>) {
    return as(Value{});
  } else {
    const auto range = value_range(*tree, typename Leaves::Reader(*leaves));
    switch (type_of_int64(in.path, in.grid, range)) {
      case ScalarType::i32: return as(std::int32_t{});
      case ScalarType::u32: return as(std::uint32_t{});
      default: return as(double{});
    }
  }
}

/// A grid of numbers, the values of whose leaves stay in the file, or of bits, which is held
/// whole. `stream` is where its tree begins.
template <class Grid>
std::unique_ptr<VolumeSource> open_tree(const GridRequest& in, std::istream& stream) {
  using Tree = typename Grid::TreeType;
  const auto grid = openvdb::gridPtrCast<Grid>(in.read);
  if (!grid) return nullptr;
  const bool as_half = grid->saveFloatAsHalf();
  const VdbNodeCounts nodes = count_vdb_nodes<Tree>(stream, as_half);
  if constexpr (std::is_same_v<typename Tree::ValueType, bool>) {
    using Leaves = VdbLoadedLeaves<Tree>;
    check_vdb_memory(in.path, in.grid, nodes.bytes, in.request.memory);
    grid->readTopology(stream);
    grid->readBuffers(stream);
    return make_source_of_values<Tree, Leaves>(in, grid->constTreePtr(),
                                               std::make_shared<const Leaves>(), nodes.bytes);
  } else {
    using Leaves = VdbLeaves<Tree>;
    const std::size_t memory = nodes.bytes + Leaves::memory(nodes.leaves);
    check_vdb_memory(in.path, in.grid, memory, in.request.memory);
    grid->readTopology(stream);
    const auto leaves = std::make_shared<const Leaves>(in.path, stream, grid->tree(), as_half);
    return make_source_of_values<Tree, Leaves>(in, grid->constTreePtr(), leaves, memory);
  }
}

/// A grid that is in memory as a whole and takes `memory` bytes.
template <class Grid>
std::unique_ptr<VolumeSource> open_loaded_tree(const GridRequest& in, std::size_t memory) {
  using Tree = typename Grid::TreeType;
  using Leaves = VdbLoadedLeaves<Tree>;
  const auto grid = openvdb::gridPtrCast<Grid>(in.read);
  if (!grid) return nullptr;
  return make_source_of_values<Tree, Leaves>(in, grid->constTreePtr(),
                                             std::make_shared<const Leaves>(), memory);
}

/// Calls open(grid type) for each type that volumes are made of until one gives a source.
template <class Open>
std::unique_ptr<VolumeSource> open_by_type(const std::string& path, const VdbGrid& grid,
                                           const Open& open) {
  std::unique_ptr<VolumeSource> source;
  const auto attempt = [&]<class... Grids>(std::type_identity<Grids>... types) {
    ((source ? void() : void(source = open(types))), ...);
  };
  attempt(std::type_identity<openvdb::FloatGrid>{}, std::type_identity<VdbHalfGrid>{},
          std::type_identity<openvdb::DoubleGrid>{}, std::type_identity<openvdb::Int32Grid>{},
          std::type_identity<openvdb::Int64Grid>{}, std::type_identity<openvdb::BoolGrid>{},
          std::type_identity<openvdb::MaskGrid>{});
  if (!source)
    throw Error(fmt::format("'{}': grid '{}' is not of the type that it states", path, grid.name));
  return source;
}

void check_transform(const std::string& path, const VdbGrid& grid) {
  if (grid.map.find("Frustum") != std::string::npos)
    throw UsageError(fmt::format(
        "'{}': grid '{}' has a frustum for its transform ({}), whose voxels are no boxes of one "
        "size; resample it to a linear transform (vdb_tool, Houdini's VDB Resample)",
        path, grid.name, grid.map));
}

/// A file of a layout that only OpenVDB's own reader may know: it holds the grids whole.
std::unique_ptr<VolumeSource> open_loaded(const std::string& file, const VolumeRequest& request) {
  std::uint64_t memory = 0;
  const std::vector<VdbLoadedGrid> loaded =
      load_vdb_grids(file, [&](const VdbGrid& grid, std::uint64_t bytes) {
        memory += bytes;
        check_vdb_memory(file, grid, memory, request.memory);
      });
  std::vector<VdbGrid> grids;
  for (const VdbLoadedGrid& one : loaded) grids.push_back(one.description);
  name_vdb_grids(grids);
  const VdbGrid& grid = choose_vdb_grid(file, grids, request.grid);
  check_transform(file, grid);
  const GridRequest in{file, request, grid,
                       loaded[static_cast<std::size_t>(&grid - grids.data())].grid};
  return with_vdb_errors(file, grid.name, [&] {
    return open_by_type(file, grid, [&]<class Grid>(std::type_identity<Grid>) {
      return open_loaded_tree<Grid>(in, memory);
    });
  });
}

}  // namespace

std::unique_ptr<VolumeSource> open_vdb(const std::string& file, const VolumeRequest& request) {
  refuse_raw_description(file, "an OpenVDB file", request);
  refuse_selection(file, request);
  if (!read_vdb_layout(file).known()) return open_loaded(file, request);
  const std::vector<VdbGrid> grids = read_vdb_header(file);
  const VdbGrid& grid = choose_vdb_grid(file, grids, request.grid);
  check_transform(file, grid);
  return with_vdb_errors(file, grid.name, [&] {
    VdbArchive archive(file);
    const GridRequest in{file, request, grid, archive.read_grid(grids, grid)};
    return open_by_type(file, grid, [&]<class Grid>(std::type_identity<Grid>) {
      return open_tree<Grid>(in, archive.stream());
    });
  });
}

}  // namespace isobrick
