#include "io/volumes/vdb/vdb_writer.h"

#include <openvdb/openvdb.h>

#include <cstdint>
#include <type_traits>

#include "io/volumes/vdb/vdb_grid.h"
#include "io/volumes/vdb/vdb_tree.h"

namespace isobrick::inline v0 {
namespace {

template <class Sample, class Grid>
class TypedVdbWriter final : public VdbWriter {
 public:
  TypedVdbWriter(const VolumeInfo& info, const std::string& name, std::uint64_t budget)
      : grid_(Grid::create(static_cast<Value>(info.fill_value))), counted_(grid_->tree(), budget) {
    describe_vdb_grid(*grid_, info, name);
    grid_->setGridClass(info.grid_class.empty()
                            ? openvdb::GRID_FOG_VOLUME
                            : openvdb::GridBase::stringToGridClass(info.grid_class));
    activate({0, 0, 0});
    activate(info.extent - Int3{1, 1, 1});
  }

  void put(Box3 box, const std::byte* samples) override {
    for_each_vdb_leaf(
        box, [&](Int3 leaf) { put_leaf(leaf, box, reinterpret_cast<const Sample*>(samples)); });
  }

  void write(OutputFile& file) override { write_vdb_grid(file, grid_); }

 private:
  using Value = typename Grid::ValueType;

  void activate(Int3 p) {
    const openvdb::Coord at = vdb_coordinate(p);
    counted_.touch_leaf(at)->setActiveState(at, true);
  }

  /// What `box` has of the 8³ voxels from `corner` on.
  void put_leaf(Int3 corner, Box3 box, const Sample* samples) {
    const Box3 part = intersect({corner, corner + kVdbLeafExtent}, box);
    const Value background = grid_->background();
    const auto value_at = [&](Int3 p) {
      return static_cast<Value>(samples[linear_index(p - box.lo, box.extent())]);
    };
    const Value first = value_at(part.lo);
    bool constant = true, background_only = true;
    for_each_point(part, [&](Int3 p) {
      const Value value = value_at(p);
      constant = constant && same_bits(value, first);
      background_only = background_only && same_bits(value, background);
    });
    if (background_only) return;
    const openvdb::Coord at = vdb_coordinate(corner);
    if (constant && part.extent() == kVdbLeafExtent && counted_.probe_leaf(at) == nullptr)
      return counted_.add_tile(at, first, true);
    auto* leaf = counted_.touch_leaf(at);
    for_each_point(part, [&](Int3 p) {
      const Value value = value_at(p);
      if (!same_bits(value, background)) leaf->setValueOn(vdb_coordinate(p), value);
    });
  }

  typename Grid::Ptr grid_;
  CountedTree<typename Grid::TreeType> counted_;
};

}  // namespace

std::unique_ptr<VdbWriter> make_vdb_writer(const VolumeInfo& info, const std::string& name,
                                           std::uint64_t budget) {
  openvdb::initialize();
  return visit_scalar(info.type, [&](auto tag) -> std::unique_ptr<VdbWriter> {
    using T = typename decltype(tag)::type;
    using Grid = std::conditional_t<
        std::is_same_v<T, float>, openvdb::FloatGrid,
        std::conditional_t<std::is_same_v<T, double>, openvdb::DoubleGrid,
                           std::conditional_t<std::is_same_v<T, std::uint32_t>, openvdb::Int64Grid,
                                              openvdb::Int32Grid>>>;
    return std::make_unique<TypedVdbWriter<T, Grid>>(info, name, budget);
  });
}

}  // namespace isobrick
