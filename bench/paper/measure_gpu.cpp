#include "bench/paper/measure_gpu.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstring>
#include <functional>

#include <isobrick/error.h>
#include "bench/median.h"
#include "bench/paper/block_sizes.h"
#include "bench/resident_times.h"
#include "core/dense_bricks.h"
#include "core/morton.h"
#include "gpu/search/span_search.h"
#include "gpu/tile/tile_kernel.h"
#include "index/active_tiles.h"
#include "index/leaf_ranges.h"
#include "index/span_index.h"
#include "surface/cpu_extractor.h"

namespace isobrick::bench {
namespace {

constexpr int kFrames = 101;
constexpr Index kBrick = 64;  ///< cells along the bricks of the structures over cells
/// Cells whose structures are built at a time.
constexpr std::size_t kCellsAtOnce = std::size_t{1} << 26;

template <class V>
bool same_bytes(const PodBuffer<V>& a, const PodBuffer<V>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(V)) == 0;
}

void expect(bool holds, const LoadedVolume& v, const std::string& what) {
  if (!holds) throw Error(fmt::format("{}: {} differs from the CPU's", v.name, what));
}

template <class T>
class GpuMeasurement {
 public:
  GpuMeasurement(const LoadedVolume& v, const MeasureOptions& options)
      : volume_(v),
        options_(options),
        lattice_{v.extent, {kBrick, kBrick, kBrick}, v.type},
        bricks_(lattice_, v.samples.data()),
        resident_(lattice_, bricks_, 0) {
    surface_.isovalue = v.isovalue;
    surface_.roi = lattice_.box();
    find_block_ranges(v, ranges_);
    std::vector<TileWork> tiles;
    append_active_tiles<T>({{0, 0, 0}, lattice_.blocks()}, ranges_, v.isovalue, tiles);
    CpuExtractor extractor(lattice_, surface_, {});
    extractor.extract(tiles, bricks_, nullptr);
    expected_ = std::move(extractor.mesh());
  }

  nlohmann::json run() {
    nlohmann::json out;
    out["volume_bytes"] = resident_.bytes();
    out["frames"]["brute"] = frames({.brute_force = true});
    out["frames"]["linear"] = frames({});
    if (volume_.type == ScalarType::u8)
      for (const gpu::LaunchShape& shape : block_sizes()) {
        auto& o = out["threads"][std::to_string(shape.threads)];
        o["brute"] = frames({.brute_force = true, .shape = &shape});
        o["linear"] = frames({.shape = &shape});
      }
    for (const IndexKind kind : kIndexKinds)
      out["blocks"][std::string(name_of(kind))] = blocks(kind);
    if (options_.cells)
      for (const IndexKind kind : kIndexKinds)
        out["leaf1"][std::string(name_of(kind))] = single_cells(kind);
    return out;
  }

 private:
  /// From a changed isovalue to the mesh, and its part on the device.
  nlohmann::json frames(const gpu::ResidentTuning& tuning) {
    gpu::ResidentExtractor extractor(resident_, surface_, tuning);
    extractor.extract(volume_.isovalue + 1);
    extractor.extract(volume_.isovalue);
    Mesh mesh;
    extractor.download(mesh);
    expect(same_bytes(mesh.positions, expected_.positions) &&
               same_bytes(mesh.triangles, expected_.triangles),
           volume_, "the mesh");
    const double device = median(repeat_milliseconds(extractor, kFrames)) * 1e-3;
    return {{"contour_s", contour_seconds(extractor)},
            {"device_s", device},
            {"extra_bytes", extractor.bytes()}};
  }

  double contour_seconds(gpu::ResidentExtractor& extractor) const {
    return changed_isovalue_seconds(extractor, volume_.isovalue, volume_.isovalue + 1, kFrames);
  }

  /// Seconds on the device of a search, from the isovalue to the ids.
  double search_seconds(gpu::SpanSearch& search) const {
    std::vector<double> seconds;
    for (int i = 0; i < kFrames; ++i) {
      search.search(volume_.isovalue);
      seconds.push_back(search.search_milliseconds() * 1e-3);
    }
    return median(seconds);
  }

  /// One structure over all blocks of 16³ cells, their ranges on the device.
  nlohmann::json blocks(IndexKind kind) const {
    const std::span<const ValueRange<T>> ranges(ranges_);
    const std::vector<Int3> grid{lattice_.blocks()};
    const std::vector<std::byte> bytes = build_index<T>(kind, ranges, grid[0]);
    std::vector<double> seconds;
    for (int i = 0; i < options_.runs; ++i)
      seconds.push_back(gpu::SpanSearch(kind, ranges, grid).build_milliseconds() * 1e-3);
    gpu::SpanSearch search(kind, ranges, grid);
    expect(search.download(0) == bytes, volume_, fmt::format("the {} over blocks", name_of(kind)));
    std::vector<std::uint32_t> first, ids, expected;
    search.search(volume_.isovalue);
    search.answers(first, ids);
    query_ascending(view_index(bytes), volume_.isovalue, expected);
    expect(ids == expected, volume_, fmt::format("the answer of the {}", name_of(kind)));
    return {{"build_s", median(seconds)},
            {"search_s", search_seconds(search)},
            {"bytes", search.index_bytes()}};
  }

  /// A structure for each brick of 64³ cells, as many at a time as kCellsAtOnce allows.
  nlohmann::json single_cells(IndexKind kind) const {
    const Int3 cells = volume_.extent - Int3{1, 1, 1};
    std::vector<Int3> origins;
    for_each_morton(ceil_div(cells, {kBrick, kBrick, kBrick}),
                    [&](Int3 b) { origins.push_back(b * kBrick); });
    double build = 0, search = 0;
    std::uint64_t bytes = 0, found = 0;
    for (std::size_t begin = 0; begin < origins.size();) {
      std::vector<Int3> grids;
      std::vector<std::size_t> first;
      std::size_t items = 0, end = begin;
      for (; end < origins.size() && items < kCellsAtOnce; ++end) {
        const Int3 hi = min(origins[end] + Int3{kBrick, kBrick, kBrick}, cells);
        grids.push_back(hi - origins[end]);
        first.push_back(items);
        items += static_cast<std::size_t>(volume(grids.back()));
      }
      std::vector<ValueRange<T>> ranges(items);
      tbb::parallel_for(begin, end, [&](std::size_t i) {
        std::vector<ValueRange<T>> own;
        const Int3 lo = origins[i], hi = lo + grids[i - begin];
        leaf_ranges(volume_.block<T>(lo, hi), 1, own);
        std::copy(own.begin(), own.end(),
                  ranges.begin() + static_cast<std::ptrdiff_t>(first[i - begin]));
      });
      const std::span<const ValueRange<T>> view(ranges);
      // The first build also finds out how much memory it takes.
      gpu::SpanSearch(kind, view, grids);
      gpu::SpanSearch indices(kind, view, grids);
      build += indices.build_milliseconds() * 1e-3;
      check_last(indices, kind, view.subspan(first.back()), grids.back());
      found += indices.search(volume_.isovalue);
      search += search_seconds(indices);
      bytes += indices.index_bytes();
      begin = end;
    }
    return {{"build_s", build}, {"search_s", search}, {"bytes", bytes}, {"active_cells", found}};
  }

  void check_last(const gpu::SpanSearch& indices, IndexKind kind,
                  std::span<const ValueRange<T>> ranges, Int3 grid) const {
    expect(indices.download(indices.size() - 1) == build_index<T>(kind, ranges, grid), volume_,
           fmt::format("the {} over cells", name_of(kind)));
  }

  const LoadedVolume& volume_;
  MeasureOptions options_;
  Lattice lattice_;
  DenseBricks bricks_;
  SurfaceOptions surface_;
  gpu::DeviceVolume resident_;
  std::vector<ValueRange<T>> ranges_;
  Mesh expected_;
};

}  // namespace

nlohmann::json measure_gpu(const LoadedVolume& v, const MeasureOptions& options) {
  return visit_scalar(v.type, [&](auto tag) {
    return GpuMeasurement<typename decltype(tag)::type>(v, options).run();
  });
}

}  // namespace isobrick::bench
