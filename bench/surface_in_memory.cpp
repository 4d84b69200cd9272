// Decoded bricks in memory to an indexed mesh in memory, ranges known, output
// buffers reused, beside vtkFlyingEdges3D on the same samples in the same run.
//
//   bench_surface --raw bonsai_256x256x256_uint8.raw --isovalue 45
//   bench_surface --gyroid 512
//   MALLOC_MMAP_MAX_=0 MALLOC_TRIM_THRESHOLD_=100000000000 bench_surface …   # VTK's heap kept warm
// Built as in bench/README.md.

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <vector>

#include "bench/volume.h"
#include "core/dense_bricks.h"
#include "index/active_tiles.h"
#include "surface/cpu_extractor.h"
#ifdef ISOBRICK_WITH_VTK
#include "bench/vtk_peer.h"
#endif

namespace isobrick::bench {
namespace {

using Clock = std::chrono::steady_clock;

Volume gyroid(Index n, double periods) {
  Volume v{{n, n, n}, ScalarType::u8, std::vector<std::byte>(static_cast<std::size_t>(n * n * n))};
  std::vector<double> s(static_cast<std::size_t>(n)), c(s.size());
  for (std::size_t i = 0; i < s.size(); ++i) {
    const double angle = static_cast<double>(i) * periods * 2 * M_PI / static_cast<double>(n);
    s[i] = std::sin(angle);
    c[i] = std::cos(angle);
  }
  std::byte* out = v.samples.data();
  for (std::size_t z = 0; z < s.size(); ++z)
    for (std::size_t y = 0; y < s.size(); ++y)
      for (std::size_t x = 0; x < s.size(); ++x)
        *out++ = static_cast<std::byte>(127.5 + 42 * (s[x] * c[y] + s[y] * c[z] + s[z] * c[x]));
  return v;
}

void print(const std::string& what, double median, double least, std::uint64_t triangles,
           std::uint64_t vertices) {
  fmt::print("  {:<34} median {:8.2f} ms   least {:8.2f} ms   {} triangles, {} vertices\n", what,
             median * 1e3, least * 1e3, triangles, vertices);
}

void compare(const Volume& v, double isovalue, Index brick, int runs, bool drop_degenerate,
             [[maybe_unused]] bool unwelded) {
  const Lattice lattice{v.extent, {brick, brick, brick}, v.type};
  const DenseBricks bricks(lattice, v.samples.data());
  visit_scalar(v.type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    std::vector<ValueRange<T>> ranges;
    find_block_ranges(v, ranges);
#ifdef ISOBRICK_WITH_VTK
    VtkPeer peer(v.extent.x, v.extent.y, v.extent.z, static_cast<int>(v.type),
                 const_cast<std::byte*>(v.samples.data()));
#endif
    for (const bool normals : {false, true})
      for (const int threads : {1, 2}) {
        SurfaceOptions options;
        options.isovalue = isovalue;
        options.normals = normals;
        options.roi = lattice.box();
        options.drop_degenerate = drop_degenerate;
        CpuExtractor extractor(lattice, options, {.tiles = CpuExtractor::preferred_batch(threads)});
        std::vector<TileWork> tiles;
        tbb::task_arena arena(threads);
        std::vector<double> ours, theirs;
        std::uint64_t their_triangles = 0, their_vertices = 0;
        for (int i = -2; i < runs; ++i) {
          const auto start = Clock::now();
          arena.execute([&] {
            tiles.clear();
            extractor.restart();
            append_active_tiles<T>({{0, 0, 0}, lattice.blocks()}, ranges, isovalue, tiles);
            extractor.extract(tiles, bricks, nullptr);
          });
          const std::chrono::duration<double> took = Clock::now() - start;
          if (i >= 0) ours.push_back(took.count());
#ifdef ISOBRICK_WITH_VTK
          if (unwelded) continue;
          const auto peer_run = peer.run(isovalue, normals, threads);
          if (i >= 0) theirs.push_back(peer_run.seconds);
          their_triangles = peer_run.triangles;
          their_vertices = peer_run.vertices;
#endif
        }
        std::sort(ours.begin(), ours.end());
        std::sort(theirs.begin(), theirs.end());
        const std::size_t mid = ours.size() / 2;
        const SurfaceReport made = extractor.report();
        print(fmt::format("isobrick, {} thread(s){}", threads, normals ? ", normals" : ""),
              ours[mid], ours[0], made.triangles, made.vertices);
        if (!theirs.empty()) {
          print(fmt::format("flying edges, {} thread(s){}", threads, normals ? ", normals" : ""),
                theirs[mid], theirs[0], their_triangles, their_vertices);
          fmt::print("  -> {:.2f} times as fast\n", theirs[mid] / ours[mid]);
        }
        if (drop_degenerate)
          fmt::print("  {} degenerate triangles left out\n", made.degenerate_triangles);
        if (threads == 1 && !normals) {
          const double cells = static_cast<double>(volume(v.extent - Int3{1, 1, 1}));
          fmt::print("  tiles {} of {}, about {:.2f} % of the cells active\n", tiles.size(),
                     volume(lattice.tiles()), 50.0 * static_cast<double>(made.triangles) / cells);
        }
      }
  });
}

}  // namespace
}  // namespace isobrick::bench

int main(int argc, char** argv) {
  using namespace isobrick;
  CLI::App app{"Bricks in memory to mesh in memory, beside vtkFlyingEdges3D"};
  std::string raw;
  Index n = 512, brick = 64;
  double isovalue = 127.5, periods = 6;
  int runs = 9;
  bool drop_degenerate = false, unwelded = false;
  app.add_option("--raw", raw, "a raw volume (else a gyroid)");
  app.add_option("--gyroid", n, "edge of the gyroid, samples");
  app.add_option("--periods", periods, "of the gyroid along each axis");
  app.add_option("--isovalue", isovalue);
  app.add_option("--brick", brick);
  app.add_option("--runs", runs);
  app.add_flag("--drop-degenerate", drop_degenerate, "leave degenerate triangles out");
  app.add_flag("--unwelded", unwelded, "leave the peer out");
  CLI11_PARSE(app, argc, argv);
#ifdef ISOBRICK_WITH_VTK
  fmt::print("VTK {}\n", bench::VtkPeer::version());
#endif
  const auto v = raw.empty() ? bench::gyroid(n, periods) : bench::read_raw(raw);
  fmt::print("{} isovalue {}\n", raw.empty() ? fmt::format("gyroid {}³ u8", n) : raw, isovalue);
  bench::compare(v, isovalue, brick, runs, drop_degenerate, unwelded);
}
