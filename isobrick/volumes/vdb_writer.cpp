#include "isobrick/volumes/vdb_writer.h"

#include <fmt/format.h>
#include <openvdb/openvdb.h>

#include <cstdint>
#include <cstring>
#include <type_traits>
#include <utility>

#include "isobrick/core/error.h"

namespace isobrick {
namespace {

/// Edge of OpenVDB's leaves.
constexpr int kLeaf = 8;

openvdb::math::Transform::Ptr grid_transform(const Transform& t) {
  openvdb::Mat4d m = openvdb::Mat4d::identity();
  for (int axis = 0; axis < 3; ++axis)
    for (int row = 0; row < 3; ++row)
      m(axis, row) = t.direction[static_cast<std::size_t>(3 * row + axis)] * t.spacing[axis];
  for (int row = 0; row < 3; ++row) m(3, row) = t.origin[row];
  return openvdb::math::Transform::createLinearTransform(m);
}

template <class Sample, class Grid>
class TypedVdbWriter final : public VdbWriter {
 public:
  TypedVdbWriter(const VolumeInfo& info, const std::string& name)
      : extent_(info.extent), grid_(Grid::create(static_cast<Value>(info.fill_value))) {
    grid_->setName(name);
    grid_->setTransform(grid_transform(info.transform));
    grid_->setGridClass(info.grid_class.empty()
                            ? openvdb::GRID_FOG_VOLUME
                            : openvdb::GridBase::stringToGridClass(info.grid_class));
    if (!info.transform.unit.empty())
      grid_->insertMeta("unit", openvdb::StringMetadata(info.transform.unit));
    activate({0, 0, 0});
    activate(extent_ - Int3{1, 1, 1});
  }

  void put(Box3 box, const std::byte* samples) override {
    const Int3 first{box.lo.x / kLeaf, box.lo.y / kLeaf, box.lo.z / kLeaf};
    for_each_point({first, ceil_div(box.hi, {kLeaf, kLeaf, kLeaf})}, [&](Int3 leaf) {
      put_leaf(leaf * Index{kLeaf}, box, reinterpret_cast<const Sample*>(samples));
    });
  }

  std::uint64_t memory() const override { return bytes_; }

  void write(const std::string& path) override {
    try {
      openvdb::io::File file(path);
      file.write({grid_});
    } catch (const std::exception& error) {
      throw Error(fmt::format("cannot write '{}': {}", path, error.what()));
    }
  }

 private:
  using Value = typename Grid::ValueType;
  using Tree = typename Grid::TreeType;
  using Leaf = typename Tree::LeafNodeType;

  static openvdb::Coord coordinate(Int3 p) {
    return {static_cast<int>(p.x), static_cast<int>(p.y), static_cast<int>(p.z)};
  }
  static bool same(Value a, Value b) { return std::memcmp(&a, &b, sizeof(Value)) == 0; }

  void activate(Int3 p) { grid_->tree().setActiveState(coordinate(p), true); }

  /// The leaf there; new nodes are counted, which is quicker than to ask the tree.
  Leaf* touch_leaf(const openvdb::Coord& at) {
    using Parent = typename Tree::RootNodeType::ChildNodeType::ChildNodeType;
    Tree& tree = grid_->tree();
    if (Leaf* leaf = tree.probeLeaf(at)) return leaf;
    bytes_ += sizeof(Leaf) + Leaf::SIZE * sizeof(Value);
    if (tree.template probeConstNode<Parent>(at) == nullptr) bytes_ += sizeof(Parent);
    return tree.touchLeaf(at);
  }

  /// What `box` has of the 8³ voxels from `corner` on.
  void put_leaf(Int3 corner, Box3 box, const Sample* samples) {
    const Box3 part = intersect({corner, corner + Int3{kLeaf, kLeaf, kLeaf}}, box);
    const Value background = grid_->background();
    const auto value_at = [&](Int3 p) {
      return static_cast<Value>(samples[linear_index(p - box.lo, box.extent())]);
    };
    const Value first = value_at(part.lo);
    bool constant = true, background_only = true;
    for_each_point(part, [&](Int3 p) {
      const Value value = value_at(p);
      constant = constant && same(value, first);
      background_only = background_only && same(value, background);
    });
    if (background_only) return;
    Tree& tree = grid_->tree();
    if (constant && volume(part.extent()) == kLeaf * kLeaf * kLeaf &&
        tree.probeLeaf(coordinate(corner)) == nullptr)
      return tree.addTile(1, coordinate(corner), first, true);
    Leaf* leaf = touch_leaf(coordinate(corner));
    for_each_point(part, [&](Int3 p) {
      const Value value = value_at(p);
      if (!same(value, background)) leaf->setValueOn(coordinate(p), value);
    });
  }

  Int3 extent_;
  typename Grid::Ptr grid_;
  std::uint64_t bytes_ = 0;
};

}  // namespace

std::unique_ptr<VdbWriter> make_vdb_writer(const VolumeInfo& info, const std::string& name) {
  openvdb::initialize();
  return visit_scalar(info.type, [&](auto tag) -> std::unique_ptr<VdbWriter> {
    using T = typename decltype(tag)::type;
    using Grid = std::conditional_t<
        std::is_same_v<T, float>, openvdb::FloatGrid,
        std::conditional_t<std::is_same_v<T, double>, openvdb::DoubleGrid,
                           std::conditional_t<std::is_same_v<T, std::uint32_t>, openvdb::Int64Grid,
                                              openvdb::Int32Grid>>>;
    return std::make_unique<TypedVdbWriter<T, Grid>>(info, name);
  });
}

}  // namespace isobrick
