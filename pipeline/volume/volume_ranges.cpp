#include "pipeline/volume/volume_ranges.h"

#include <algorithm>
#include <atomic>
#include <cstddef>

#include <isobrick/pod_buffer.h>
#include "index/active_tiles.h"
#include "index/leaf_ranges.h"
#include "index/row_ranges.h"

namespace isobrick::inline v0 {
namespace {

constexpr Index kBlocksOfTile = kTileEdge / kBlockEdge;

/// The same point with its coordinates in the order of `axes`.
Int3 permute(Int3 p, const std::array<int, 3>& axes) {
  return {p[axes[0]], p[axes[1]], p[axes[2]]};
}

template <class T>
class TypedVolumeRanges final : public VolumeRanges {
 public:
  explicit TypedVolumeRanges(const Lattice& lattice)
      : lattice_(lattice), blocks_(lattice.blocks()) {
    ranges_.resize(static_cast<std::size_t>(volume(blocks_)));
    for (ValueRange<T>& range : ranges_) range = {};
  }

  void scan(const ArraySamples& samples, Box3 blocks) override {
    const Box3 box =
        intersect({blocks.lo * kBlockEdge, blocks.hi * kBlockEdge + Int3{1, 1, 1}}, lattice_.box());
    if (const SampleArray* array = samples.in_place()) {
      const auto& axes = samples.axes();
      const Int3 strides = permute(array->strides, axes);
      constexpr auto size = static_cast<Index>(sizeof(T));
      scan(blocks, axes,
           {reinterpret_cast<const T*>(array->at(box.lo)), permute(box.extent(), axes),
            strides.y / size, strides.z / size});
      return;
    }
    PodBuffer<T> dense;
    dense.resize(static_cast<std::size_t>(volume(box.extent())));
    samples.copy(box, reinterpret_cast<std::byte*>(dense.data()));
    scan(blocks, {0, 1, 2}, SampleBlock<T>::dense(dense.data(), box.extent()));
  }

  void append_tiles(Box3 tiles, double isovalue, std::vector<TileWork>& out) const override {
    const Box3 blocks =
        intersect({tiles.lo * kBlocksOfTile, tiles.hi * kBlocksOfTile}, {{0, 0, 0}, blocks_});
    if (blocks == Box3{{0, 0, 0}, blocks_})
      return append_active_tiles<T>(blocks, ranges_.span(), isovalue, out);
    std::vector<ValueRange<T>> part;
    for_each_point(blocks, [&](Int3 b) { part.push_back(at(b)); });
    append_active_tiles<T>(blocks, part, isovalue, out);
  }

  bool has_nan() const override { return has_nan_; }

  ValueRange<double> all() const override {
    ValueRange<T> all;
    for (const ValueRange<T>& range : ranges_) all.include(range);
    if (all.empty()) return {};
    return {static_cast<double>(all.lo), static_cast<double>(all.hi)};
  }

 private:
  ValueRange<T>& at(Int3 b) { return ranges_[static_cast<std::size_t>(linear_index(b, blocks_))]; }
  const ValueRange<T>& at(Int3 b) const {
    return ranges_[static_cast<std::size_t>(linear_index(b, blocks_))];
  }

  /// `samples` has the axes in the order of `axes`.
  void scan(Box3 blocks, const std::array<int, 3>& axes, const SampleBlock<T>& samples) {
    ColumnRanges<T> columns;
    bool has_nan = false;
    const Int3 n = samples.extent, grid = leaf_grid(n, kBlockEdge);
    const auto last = [](Index i, Index size) { return std::min((i + 1) * kBlockEdge + 1, size); };
    for (Index z = 0; z < grid.z; ++z)
      for (Index y = 0; y < grid.y; ++y) {
        const Index z0 = z * kBlockEdge, y0 = y * kBlockEdge;
        columns.reset(n.x);
        has_nan |= columns.add(
            {.first = samples.data + z0 * samples.plane_stride + y0 * samples.row_stride,
             .width = n.x,
             .rows = last(y, n.y) - y0,
             .planes = last(z, n.z) - z0,
             .row_stride = samples.row_stride,
             .plane_stride = samples.plane_stride});
        for (Index x = 0; x < grid.x; ++x) {
          const Int3 p{x, y, z};
          Int3 b = blocks.lo;
          for (int i = 0; i < 3; ++i) b[axes[static_cast<std::size_t>(i)]] += p[i];
          at(b) = columns.over(x * kBlockEdge, last(x, n.x));
        }
      }
    if (has_nan) has_nan_ = true;
  }

  Lattice lattice_;
  Int3 blocks_;
  PodBuffer<ValueRange<T>> ranges_;  ///< C order [z, y, x]
  std::atomic<bool> has_nan_ = false;
};

}  // namespace

std::unique_ptr<VolumeRanges> make_volume_ranges(const Lattice& lattice) {
  return visit_scalar(lattice.type, [&](auto tag) -> std::unique_ptr<VolumeRanges> {
    return std::make_unique<TypedVolumeRanges<typename decltype(tag)::type>>(lattice);
  });
}

std::uint64_t volume_ranges_bytes(const Lattice& lattice) {
  return static_cast<std::uint64_t>(volume(lattice.blocks())) * 2 * lattice.sample_bytes();
}

}  // namespace isobrick
