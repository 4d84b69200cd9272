// What Topology::trilinear costs: decoded bricks in memory to an indexed mesh in memory, with both
// topologies in turn.
//
//   bench_topology --raw bonsai_256x256x256_uint8.raw --isovalue 45
//   bench_topology --noise 128
//
// Built as in bench/README.md.

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <random>
#include <vector>

#include "bench/volume.h"
#include "core/dense_bricks.h"
#include "index/active_tiles.h"
#include "surface/cpu_extractor.h"

namespace isobrick::bench {
namespace {

using Clock = std::chrono::steady_clock;

Volume noise(Index n) {
  Volume v{{n, n, n}, ScalarType::u8, std::vector<std::byte>(static_cast<std::size_t>(n * n * n))};
  std::mt19937 random(1);
  for (std::byte& sample : v.samples) sample = static_cast<std::byte>(random() >> 24);
  return v;
}

struct Runs {
  std::vector<double> seconds;
  SurfaceReport made;

  double median() {
    std::sort(seconds.begin(), seconds.end());
    return seconds[seconds.size() / 2];
  }
};

template <class T>
void compare(const Volume& v, double isovalue, int count, int threads, bool normals) {
  const Lattice lattice{v.extent, {64, 64, 64}, v.type};
  const DenseBricks bricks(lattice, v.samples.data());
  std::vector<ValueRange<T>> ranges;
  find_block_ranges(v, ranges);
  std::vector<TileWork> tiles;
  append_active_tiles<T>({{0, 0, 0}, lattice.blocks()}, ranges, isovalue, tiles);
  tbb::task_arena arena(threads);
  SurfaceOptions options;
  options.isovalue = isovalue;
  options.normals = normals;
  options.roi = lattice.box();
  options.may_have_nan = std::is_floating_point_v<T>;
  const ExtractorLimits limits{.tiles = CpuExtractor::preferred_batch(threads)};
  CpuExtractor consistent(lattice, options, limits);
  options.topology = Topology::trilinear;
  CpuExtractor trilinear(lattice, options, limits);
  Runs runs[2];
  for (int i = -2; i < count; ++i)
    for (CpuExtractor* extractor : {&consistent, &trilinear}) {
      const auto start = Clock::now();
      arena.execute([&] {
        extractor->restart();
        extractor->extract(tiles, bricks, nullptr);
      });
      const std::chrono::duration<double> took = Clock::now() - start;
      Runs& of = runs[extractor == &trilinear];
      if (i >= 0) of.seconds.push_back(took.count());
      of.made = extractor->report();
    }
  for (Runs& of : runs)
    fmt::print("  {:<10} median {:8.2f} ms   {} triangles, {} vertices\n",
               &of == runs ? "consistent" : "trilinear", of.median() * 1e3, of.made.triangles,
               of.made.vertices);
  fmt::print("  {} thread(s){}: {:.3f} times the time\n", threads, normals ? ", normals" : "",
             runs[1].median() / runs[0].median());
}

}  // namespace
}  // namespace isobrick::bench

int main(int argc, char** argv) {
  using namespace isobrick;
  CLI::App app{"The cost of the trilinear topology"};
  std::string raw;
  Index n = 128;
  double isovalue = 127.5;
  int runs = 15, threads = 1;
  app.add_option("--raw", raw, "a raw volume (else noise)");
  app.add_option("--noise", n, "edge of the noise, samples");
  app.add_option("--isovalue", isovalue);
  app.add_option("--runs", runs);
  app.add_option("--threads", threads);
  CLI11_PARSE(app, argc, argv);
  const auto v = raw.empty() ? bench::noise(n) : bench::read_raw(raw);
  fmt::print("{} isovalue {}\n", raw.empty() ? fmt::format("noise {}³ u8", n) : raw, isovalue);
  visit_scalar(v.type, [&](auto tag) {
    for (const bool normals : {false, true})
      bench::compare<typename decltype(tag)::type>(v, isovalue, runs, threads, normals);
  });
}
