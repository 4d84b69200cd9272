// Arrays in memory to meshes in memory: VolumeExtractor beside vtkFlyingEdges3D on the same samples
// in the same run. The first isovalue includes the ranges; "fresh" takes new memory for the mesh,
// "reused" that of the mesh before. VTK takes new memory every time.
//
//   bench_arrays --gyroid 512 --types u8,i16,f32,f64 --threads 2
//   bench_arrays --raw bonsai_256x256x256_uint8.raw --isovalue 45
// Built as in bench/README.md.

#include <fmt/format.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include <isobrick/volume_extractor.h>
#include "bench/guarded_main.h"
#include "bench/median.h"
#include "bench/volume.h"
#ifdef ISOBRICK_WITH_VTK
#include "bench/vtk_peer.h"
#endif

namespace isobrick::bench {
namespace {

struct Run {
  double seconds = 0;
  long faults = 0;  ///< pages that were touched first
};

long page_faults() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_minflt;
}

Run measure(const std::function<void()>& work) {
  const long before = page_faults();
  const auto start = std::chrono::steady_clock::now();
  work();
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  return {took.count(), page_faults() - before};
}

template <class T>
Volume gyroid(Index n, double periods) {
  Volume v{{n, n, n}, scalar_type_of<T>, {}};
  v.samples.resize(static_cast<std::size_t>(n * n * n) * sizeof(T));
  std::vector<double> s(static_cast<std::size_t>(n)), c(s.size());
  for (std::size_t i = 0; i < s.size(); ++i) {
    const double angle = static_cast<double>(i) * periods * 2 * M_PI / static_cast<double>(n);
    s[i] = std::sin(angle);
    c[i] = std::cos(angle);
  }
  T* out = reinterpret_cast<T*>(v.samples.data());
  for (std::size_t z = 0; z < s.size(); ++z)
    for (std::size_t y = 0; y < s.size(); ++y)
      for (std::size_t x = 0; x < s.size(); ++x)
        *out++ = static_cast<T>(63.5 + 21 * (s[x] * c[y] + s[y] * c[z] + s[z] * c[x]));
  return v;
}

void print(const std::string& what, const std::vector<Run>& runs, double peer) {
  std::vector<double> seconds;
  std::vector<long> faults;
  for (const Run& run : runs) {
    seconds.push_back(run.seconds);
    faults.push_back(run.faults);
  }
  fmt::print("  {:<28} median {:8.2f} ms, least {:8.2f}, {:7} page faults{}\n", what,
             median(seconds) * 1e3, *std::min_element(seconds.begin(), seconds.end()) * 1e3,
             median(faults),
             peer > 0 ? fmt::format(", {:5.2f} times as fast", peer / median(seconds)) : "");
}

void compare(const Volume& v, double isovalue, bool normals, int threads, int runs) {
  isobrick::Volume volume;
  volume.samples = v.samples.data();
  volume.type = v.type;
  volume.extent = v.extent;
  const ExtractOptions options{.isovalue = isovalue, .normals = normals, .threads = threads};
  std::vector<Run> first, fresh, reused;
  std::uint64_t triangles = 0;
  double peer = 0;
#ifdef ISOBRICK_WITH_VTK
  std::vector<Run> theirs;
  VtkPeer vtk(v.extent.x, v.extent.y, v.extent.z, static_cast<int>(v.type),
              const_cast<std::byte*>(v.samples.data()));
#endif
  for (int i = -1; i < runs; ++i) {
    std::vector<Run> run;
    VolumeExtractor extractor(volume);
    Mesh mesh;
    run.push_back(measure([&] { extractor.extract(options, mesh); }));
    triangles = mesh.triangles.size();
    run.push_back(measure([&] {
      Mesh other;
      extractor.extract(options, other);
    }));
    run.push_back(measure([&] { extractor.extract(options, mesh); }));
#ifdef ISOBRICK_WITH_VTK
    run.push_back(measure([&] { vtk.run(isovalue, normals, threads); }));
#endif
    if (i < 0) continue;
    first.push_back(run[0]);
    fresh.push_back(run[1]);
    reused.push_back(run[2]);
#ifdef ISOBRICK_WITH_VTK
    theirs.push_back(run[3]);
#endif
  }
  fmt::print("{}x{}x{} {}, isovalue {}{}, {} thread(s): {} triangles\n", v.extent.x, v.extent.y,
             v.extent.z, short_name(v.type), isovalue, normals ? ", normals" : "", threads,
             triangles);
#ifdef ISOBRICK_WITH_VTK
  print("flying edges", theirs, 0);
  std::vector<double> seconds;
  for (const Run& run : theirs) seconds.push_back(run.seconds);
  peer = median(seconds);
#endif
  print("first isovalue, fresh", first, peer);
  print("later isovalue, fresh", fresh, peer);
  print("later isovalue, reused", reused, peer);
}

int run(int argc, char** argv) {
  CLI::App app{"Arrays in memory to meshes in memory, beside vtkFlyingEdges3D"};
  std::string raw;
  Index n = 512;
  double isovalue = 63.5, periods = 6;
  int runs = 5;
  bool normals = false;
  std::vector<int> threads{1, 2};
  std::vector<std::string> types{"u8", "i16", "f32", "f64"};
  app.add_option("--raw", raw, "a raw volume (else gyroids)");
  app.add_option("--gyroid", n, "edge of the gyroid, samples");
  app.add_option("--periods", periods, "of the gyroid along each axis");
  app.add_option("--types", types, "of the gyroid's samples")->delimiter(',');
  app.add_option("--isovalue", isovalue);
  app.add_option("--threads", threads)->delimiter(',');
  app.add_option("--runs", runs);
  app.add_flag("--normals", normals);
  CLI11_PARSE(app, argc, argv);
#ifdef ISOBRICK_WITH_VTK
  fmt::print("VTK {}\n", VtkPeer::version());
#endif
  const auto compare_with = [&](const Volume& v) {
    for (const int count : threads) compare(v, isovalue, normals, count, runs);
  };
  if (!raw.empty()) {
    compare_with(read_raw(raw));
    return 0;
  }
  for (const std::string& name : types) {
    const auto type = parse_scalar_type(name);
    if (!type) throw CLI::ValidationError("--types", "no sample type " + name);
    compare_with(visit_scalar(
        *type, [&](auto tag) { return gyroid<typename decltype(tag)::type>(n, periods); }));
  }
  return 0;
}

}  // namespace
}  // namespace isobrick::bench

int main(int argc, char** argv) {
  return isobrick::bench::guarded_main("bench_arrays", isobrick::bench::run, argc, argv);
}
