#include "bench/paper/measure.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <functional>
#include <mutex>

#include "bench/median.h"
#include "bench/paper/cell_by_cell.h"
#include "core/dense_bricks.h"
#include "core/morton.h"
#include "index/active_tiles.h"
#include "index/block_index.h"
#include "index/leaf_ranges.h"
#include "index/span_index.h"
#include "surface/cpu_extractor.h"
#ifdef ISOBRICK_WITH_VTK
#include "bench/vtk_tree_peer.h"
#endif

namespace isobrick::bench {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_of(const std::function<void()>& f) {
  const auto start = Clock::now();
  f();
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// The median of so many runs, after one that does not count.
double median_of(int runs, const std::function<void()>& f) {
  f();
  std::vector<double> took;
  for (int i = 0; i < runs; ++i) took.push_back(seconds_of(f));
  return median(took);
}

constexpr Index kBrick = 64;  ///< cells along the bricks of the structures over cells

template <class T>
class Measurement {
 public:
  Measurement(const LoadedVolume& v, const MeasureOptions& options)
      : volume_(v),
        options_(options),
        arena_(options.threads > 0 ? options.threads : tbb::task_arena::automatic),
        lattice_{v.extent, {kBrick, kBrick, kBrick}, v.type},
        bricks_(lattice_, v.samples.data()),
        surface_(make_surface()),
        extractor_(lattice_, surface_,
                   {.tiles = CpuExtractor::preferred_batch(arena_.max_concurrency())}) {}

  nlohmann::json run() {
    nlohmann::json out;
    const Int3 cells = max(volume_.extent - Int3{1, 1, 1}, Int3{0, 0, 0});
    out["name"] = volume_.name;
    out["real"] = volume_.real;
    out["extent"] = {volume_.extent.x, volume_.extent.y, volume_.extent.z};
    out["isovalue"] = volume_.isovalue;
    out["cells"] = volume(cells);
    out["threads"] = arena_.max_concurrency();
    out["sample_bytes"] = volume_.samples.size();
    std::vector<std::vector<Vec3f>> soup;
    out["cell_by_cell_s"] = median_of(options_.runs, [&] {
      arena_.execute([&] {
        out["cell_by_cell_triangles"] =
            cell_by_cell(volume_.data<T>(), volume_.extent, volume_.isovalue, soup);
      });
    });
    soup = {};
    out["brute_s"] = contour([&](double, std::vector<TileWork>& tiles) { all_tiles(tiles); });
    out["triangles"] = extractor_.report().triangles;
    out["vertices"] = extractor_.report().vertices;
    out["active_cells_percent"] = 100.0 * static_cast<double>(count_active_cells()) /
                                  static_cast<double>(std::max<Index>(1, volume(cells)));
    blocks(out["blocks"]);
    if (options_.cells) single_cells(out["leaf1"]);
#ifdef ISOBRICK_WITH_VTK
    if (options_.peers) peers(out["vtk"]);
#endif
    return out;
  }

  std::uint64_t triangles() {
    extractor_.restart();
    std::vector<TileWork> tiles;
    all_tiles(tiles);
    arena_.execute([&] { extractor_.extract(tiles, bricks_, nullptr); });
    return extractor_.report().triangles;
  }

 private:
  SurfaceOptions make_surface() const {
    SurfaceOptions surface;
    surface.isovalue = volume_.isovalue;
    surface.roi = lattice_.box();
    return surface;
  }

  void all_tiles(std::vector<TileWork>& tiles) const {
    for_each_morton(lattice_.tiles(),
                    [&](Int3 t) { tiles.push_back({.tile = t, .active_blocks = 0xff}); });
  }

  /// Seconds from an isovalue to the mesh, search included.
  double contour(const std::function<void(double, std::vector<TileWork>&)>& search) {
    std::vector<TileWork> tiles;
    return median_of(options_.runs, [&] {
      tiles.clear();
      extractor_.restart();
      search(volume_.isovalue, tiles);
      arena_.execute([&] { extractor_.extract(tiles, bricks_, nullptr); });
    });
  }

  std::uint64_t count_active_cells() const {
    const T* s = volume_.data<T>();
    const Int3 e = volume_.extent;
    std::atomic<std::uint64_t> active = 0;
    tbb::parallel_for(Index{0}, e.z - 1, [&](Index z) {
      std::uint64_t n = 0;
      for (Index y = 0; y + 1 < e.y; ++y)
        for (Index x = 0; x + 1 < e.x; ++x) {
          ValueRange<T> range;
          for (int c = 0; c < 8; ++c)
            range.include(s[linear_index({x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)}, e)]);
          n += range.stabbed_by(volume_.isovalue);
        }
      active += n;
    });
    return active;
  }

  /// One structure over all blocks of 16³ cells, the default.
  void blocks(nlohmann::json& out) {
    std::vector<ValueRange<T>> ranges;
    out["range_s"] = median_of(
        options_.runs, [&] { arena_.execute([&] { find_block_ranges(volume_, ranges); }); });
    out["items"] = ranges.size();
    const std::span<const ValueRange<T>> view(ranges);
    for (const IndexKind kind : kIndexKinds) {
      auto& o = out[std::string(name_of(kind))];
      o["build_s"] = median_of(options_.runs, [&] { BlockIndex(kind, lattice_.blocks(), view); });
      const BlockIndex index(kind, lattice_.blocks(), view);
      o["bytes"] = index.bytes();
      std::vector<TileWork> tiles;
      o["search_s"] = median_of(options_.runs, [&] {
        tiles.clear();
        index.append_active_tiles(volume_.isovalue, tiles);
      });
      o["tiles"] = tiles.size();
      o["contour_s"] = contour([&](double isovalue, std::vector<TileWork>& found) {
        index.append_active_tiles(isovalue, found);
      });
    }
  }

  /// The paper's: every cell is an item. A structure for each brick of 64³ cells,
  /// built in parallel over bricks.
  void single_cells(nlohmann::json& out) {
    const Int3 cells = volume_.extent - Int3{1, 1, 1};
    const Int3 grid = ceil_div(cells, {kBrick, kBrick, kBrick});
    std::vector<Int3> origins;
    for_each_morton(grid, [&](Int3 b) { origins.push_back(b * kBrick); });
    std::vector<std::vector<std::byte>> indices(origins.size());
    for (const IndexKind kind : kIndexKinds) {
      const auto build = [&] {
        arena_.execute([&] {
          tbb::parallel_for(std::size_t{0}, origins.size(), [&](std::size_t i) {
            std::vector<ValueRange<T>> ranges;
            const Int3 hi = min(origins[i] + Int3{kBrick, kBrick, kBrick}, cells);
            leaf_ranges(volume_.block<T>(origins[i], hi), 1, ranges);
            indices[i] = build_index<T>(kind, ranges, hi - origins[i]);
          });
        });
      };
      auto& o = out[std::string(name_of(kind))];
      o["build_s"] = seconds_of(build);
      std::uint64_t bytes = 0;
      for (const auto& index : indices) bytes += index.size();
      o["bytes"] = bytes;
      std::atomic<std::uint64_t> found = 0;
      o["search_s"] = median_of(options_.runs, [&] {
        found = 0;
        arena_.execute([&] {
          tbb::parallel_for(std::size_t{0}, indices.size(), [&](std::size_t i) {
            thread_local std::vector<std::uint32_t> ids;
            ids.clear();
            query(view_index(indices[i]), volume_.isovalue, ids);
            found += ids.size();
          });
        });
      });
      o["active_cells"] = found.load();
    }
  }

#ifdef ISOBRICK_WITH_VTK
  /// VTK's filter takes one isovalue after the other, as a user does who drags it.
  void peers(nlohmann::json& out) {
    using Tree = VtkTreePeer::Tree;
    const std::pair<const char*, Tree> trees[] = {
        {"none", Tree::none}, {"simple", Tree::simple}, {"span_space", Tree::span_space}};
    for (const auto& [name, tree] : trees) {
      VtkTreePeer peer(volume_.extent.x, volume_.extent.y, volume_.extent.z,
                       static_cast<int>(volume_.type),
                       const_cast<std::byte*>(volume_.samples.data()), tree);
      auto& o = out[name];
      const auto built = peer.build();
      o["build_s"] = built.seconds;
      o["bytes"] = built.bytes;
      peer.run(volume_.isovalue + 1);
      std::vector<double> took;
      for (int i = 0; i < 3; ++i) {
        const auto result = peer.run(volume_.isovalue);
        took.push_back(result.seconds);
        o["triangles"] = result.triangles;
        peer.run(volume_.isovalue + 1);
      }
      std::sort(took.begin(), took.end());
      o["contour_s"] = took[1];
    }
  }
#endif

  const LoadedVolume& volume_;
  MeasureOptions options_;
  tbb::task_arena arena_;
  Lattice lattice_;
  DenseBricks bricks_;
  SurfaceOptions surface_;
  CpuExtractor extractor_;
};

}  // namespace

nlohmann::json measure(const LoadedVolume& v, const MeasureOptions& options) {
  return visit_scalar(v.type, [&](auto tag) {
    return Measurement<typename decltype(tag)::type>(v, options).run();
  });
}

std::uint64_t count_triangles(const LoadedVolume& v) {
  return visit_scalar(v.type, [&](auto tag) {
    return Measurement<typename decltype(tag)::type>(v, {}).triangles();
  });
}

}  // namespace isobrick::bench
