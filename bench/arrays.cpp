// Arrays in memory to meshes in memory: VolumeExtractor beside vtkFlyingEdges3D on the same samples
// in the same run. The first isovalue includes the ranges; "fresh" takes new memory for the mesh,
// "reused" that of the mesh before. VTK takes new memory every time.
//
//   bench_arrays --gyroid 512 --types u8,i16,f32,f64 --threads 2
//   bench_arrays --raw bonsai_256x256x256_uint8.raw --isovalue 45
//   bench_arrays --function --gyroid 1024 --memory 64   # computed where it is read, never in
//   memory
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

#include <isobrick/mesh_sinks.h>
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

/// A gyroid that can be computed anywhere.
class Gyroid {
 public:
  Gyroid(Index n, double periods) : s_(static_cast<std::size_t>(n)), c_(s_.size()) {
    for (std::size_t i = 0; i < s_.size(); ++i) {
      const double angle = static_cast<double>(i) * periods * 2 * M_PI / static_cast<double>(n);
      s_[i] = std::sin(angle);
      c_[i] = std::cos(angle);
    }
  }
  Int3 extent() const {
    const auto n = static_cast<Index>(s_.size());
    return {n, n, n};
  }
  template <class T>
  void read(Box3 box, T* out) const {
    for_each_point(box, [&](Int3 p) {
      const auto x = static_cast<std::size_t>(p.x), y = static_cast<std::size_t>(p.y),
                 z = static_cast<std::size_t>(p.z);
      *out++ = static_cast<T>(63.5 + 21 * (s_[x] * c_[y] + s_[y] * c_[z] + s_[z] * c_[x]));
    });
  }

 private:
  std::vector<double> s_, c_;
};

template <class T>
Volume in_memory(const Gyroid& gyroid) {
  Volume v{gyroid.extent(), scalar_type_of<T>, {}};
  v.samples.resize(static_cast<std::size_t>(volume(v.extent)) * sizeof(T));
  gyroid.read({{0, 0, 0}, v.extent}, reinterpret_cast<T*>(v.samples.data()));
  return v;
}

/// Surfaces of samples that are computed where they are read.
template <class T>
void behind_function(const Gyroid& gyroid, const ExtractOptions& options) {
  isobrick::Volume volume;
  volume.extent = gyroid.extent();
  volume.type = scalar_type_of<T>;
  volume.concurrent_reads = true;
  volume.read = [&](Box3 box, void* out) { gyroid.read(box, static_cast<T*>(out)); };
  VolumeExtractor extractor(volume);
  for (const char* which : {"first", "second"}) {
    std::uint64_t triangles = 0;
    FunctionSink sink([&](const MeshChunk& chunk) { triangles += chunk.triangles.size(); });
    const Run run = measure([&] { extractor.extract(options, sink); });
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    fmt::print(
        "{}x{}x{} {} behind a function, {} MiB: {} surface {:.2f} s, {} triangles, peak of the "
        "process {} MiB\n",
        volume.extent.x, volume.extent.y, volume.extent.z, short_name(volume.type),
        options.memory >> 20, which, run.seconds, triangles, usage.ru_maxrss >> 10);
  }
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
  bool normals = false, function = false;
  std::uint64_t memory = 1024;
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
  app.add_flag("--function", function, "compute the gyroid where it is read");
  app.add_option("--memory", memory, "of that, MiB");
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
  const Gyroid gyroid(n, periods);
  for (const std::string& name : types) {
    const auto type = parse_scalar_type(name);
    if (!type) throw CLI::ValidationError("--types", "no sample type " + name);
    visit_scalar(*type, [&](auto tag) {
      using T = typename decltype(tag)::type;
      if (!function) return compare_with(in_memory<T>(gyroid));
      for (const int count : threads)
        behind_function<T>(
            gyroid,
            {.isovalue = isovalue, .normals = normals, .memory = memory << 20, .threads = count});
    });
  }
  return 0;
}

}  // namespace
}  // namespace isobrick::bench

int main(int argc, char** argv) {
  return isobrick::bench::guarded_main("bench_arrays", isobrick::bench::run, argc, argv);
}
