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
/// Blocks in a row whose samples are copied at a time, where they can't be read in place.
constexpr Index kBlocksOfCopy = 8;

/// The samples that the cells of a box of blocks touch.
Box3 samples_of_blocks(Box3 blocks, const Lattice& lattice) {
  return intersect({blocks.lo * kBlockEdge, blocks.hi * kBlockEdge + Int3{1, 1, 1}}, lattice.box());
}

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
    if (const SampleArray* array = samples.in_place()) {
      const Box3 box = samples_of_blocks(blocks, lattice_);
      const auto& axes = samples.axes();
      const Int3 strides = permute(array->strides, axes);
      constexpr auto size = static_cast<Index>(sizeof(T));
      scan(blocks, axes,
           {reinterpret_cast<const T*>(array->at(box.lo)), permute(box.extent(), axes),
            strides.y / size, strides.z / size});
      return;
    }
    Int3 edge{1, 1, 1};
    edge[samples.axes()[0]] = kBlocksOfCopy;  // long rows: memory is read in order
    PodBuffer<T> dense;
    for_each_point({{0, 0, 0}, ceil_div(blocks.extent(), edge)}, [&](Int3 p) {
      const Int3 lo = blocks.lo + p * edge;
      const Box3 part{lo, min(lo + edge, blocks.hi)};
      const Box3 box = samples_of_blocks(part, lattice_);
      dense.resize(static_cast<std::size_t>(volume(box.extent())));
      samples.copy(box, reinterpret_cast<std::byte*>(dense.data()));
      scan(part, {0, 1, 2}, SampleBlock<T>::dense(dense.data(), box.extent()));
    });
  }

  void append_tiles(Box3 tiles, double isovalue, const std::optional<CapSearch>& cap,
                    std::vector<TileWork>& out) const override {
    const auto append = [&](Box3 blocks, std::span<const ValueRange<T>> ranges) {
      if (cap)
        append_capped_tiles<T>(blocks, ranges, isovalue, *cap, out);
      else
        append_active_tiles<T>(blocks, ranges, isovalue, out);
    };
    const Box3 blocks =
        intersect({tiles.lo * kBlocksOfTile, tiles.hi * kBlocksOfTile}, {{0, 0, 0}, blocks_});
    if (blocks == Box3{{0, 0, 0}, blocks_}) return append(blocks, ranges_.span());
    std::vector<ValueRange<T>> part;
    for_each_point(blocks, [&](Int3 b) { part.push_back(at(b)); });
    append(blocks, part);
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

  /// Blocks with cells. An axis of one sample has none, but its samples count for all().
  Int3 scanned_blocks(Int3 samples, const std::array<int, 3>& axes) const {
    Int3 grid = leaf_grid(samples, kBlockEdge);
    for (int i = 0; i < 3; ++i)
      if (lattice_.extent[axes[static_cast<std::size_t>(i)]] == 1) grid[i] = 1;
    return grid;
  }

  /// `samples` has the axes in the order of `axes`.
  void scan(Box3 blocks, const std::array<int, 3>& axes, const SampleBlock<T>& samples) {
    ColumnRanges<T> columns;
    bool has_nan = false;
    const Int3 n = samples.extent, grid = scanned_blocks(n, axes);
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

std::uint64_t range_scan_bytes(const Lattice& lattice) {
  constexpr Index edge = kBlockEdge + 1;
  return static_cast<std::uint64_t>((kBlocksOfCopy * kBlockEdge + 1) * edge * edge) *
         lattice.sample_bytes();
}

std::uint64_t volume_ranges_bytes(const Lattice& lattice) {
  return static_cast<std::uint64_t>(volume(lattice.blocks())) * 2 * lattice.sample_bytes();
}

}  // namespace isobrick
