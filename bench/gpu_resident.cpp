// A volume resident in device memory to an indexed mesh in device memory, search
// included, beside the floor that memory bandwidth sets.
//
//   gpu_resident --raw bonsai_256x256x256_uint8.raw --isovalue 45 --json
//   gpu_resident --synth gyroid --frequency 6 --noise 0 --dims 1024,1024,1024 --type u8
//
// Correctness first: --check compares the mesh with the CPU's, byte for byte.
// Built as in bench/README.md.

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include <isobrick/device_volume.h>
#include <isobrick/error.h>
#include <isobrick/synth_source.h>
#include "bench/bandwidth.h"
#include "bench/median.h"
#include "bench/resident_times.h"
#include "bench/volume.h"
#include "core/dense_bricks.h"
#include "gpu/tile/tile_kernel.h"
#include "index/active_tiles.h"
#include "surface/cpu_extractor.h"

namespace isobrick::bench {
namespace {

using Clock = std::chrono::steady_clock;

struct Arguments {
  std::string raw, synth, type = "u8", write_raw;
  std::vector<Index> dims{512, 512, 512};
  double isovalue = 0;
  bool has_isovalue = false, normals = false, drop_degenerate = false, trilinear = false,
       cap = false, brute_force = false, check = false, cpu = false, json = false;
  double frequency = 0, noise = 0;
  int runs = 25, threads = 0;
};

Volume read_volume(const Arguments& a) {
  if (!a.raw.empty()) return read_raw(a.raw);
  const auto kind = parse_synth_kind(a.synth);
  const auto type = parse_scalar_type(a.type);
  if (!kind || !type) throw UsageError("give --raw FILE, or --synth KIND and a --type that exist");
  SynthOptions options;
  options.kind = *kind;
  options.extent = {a.dims[0], a.dims[1], a.dims[2]};
  options.type = *type;
  if (a.frequency > 0) options.frequency = a.frequency;
  options.noise = a.noise;
  return read_all(*make_synth(options));
}

/// The CPU with all its cores: the median of its times, and its mesh.
double run_cpu(const Volume& v, const Lattice& lattice, const DenseBricks& bricks,
               const SurfaceOptions& options, int runs, Mesh& mesh) {
  std::vector<double> times;
  visit_scalar(v.type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    std::vector<ValueRange<T>> ranges;
    find_block_ranges(v, ranges);
    CpuExtractor extractor(
        lattice, options,
        {.tiles = CpuExtractor::preferred_batch(tbb::this_task_arena::max_concurrency())});
    std::vector<TileWork> tiles;
    for (int i = 0; i < runs; ++i) {
      const auto start = Clock::now();
      tiles.clear();
      extractor.restart();
      const Box3 blocks{{0, 0, 0}, lattice.blocks()};
      if (options.cap)
        append_capped_tiles<T>(blocks, ranges, options.isovalue, {options.inside, options.roi},
                               tiles);
      else
        append_active_tiles<T>(blocks, ranges, options.isovalue, tiles);
      extractor.extract(tiles, bricks, nullptr);
      times.push_back(std::chrono::duration<double>(Clock::now() - start).count());
    }
    mesh = std::move(extractor.mesh());
  });
  return median(times);
}

template <class V>
bool same_bytes(const PodBuffer<V>& a, const PodBuffer<V>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(V)) == 0;
}

gpu::LaunchShape shape_with(int threads, ScalarType type, const SurfaceOptions& options) {
  for (const gpu::LaunchShape& shape : gpu::launch_shapes(gpu::kernel_of(type, options)).shapes)
    if (shape.threads == threads && shape.blocks > 0) return shape;
  throw UsageError("--threads takes 384, 640 or 1024");
}

int run(const Arguments& a) {
  const Volume v = read_volume(a);
  if (!a.write_raw.empty()) {
    std::ofstream out(a.write_raw, std::ios::binary);
    out.write(reinterpret_cast<const char*>(v.samples.data()),
              static_cast<std::streamsize>(v.samples.size()));
    if (!out.flush()) throw Error(fmt::format("cannot write '{}'", a.write_raw));
  }
  const Lattice lattice{v.extent, {64, 64, 64}, v.type};
  const DenseBricks bricks(lattice, v.samples.data());
  SurfaceOptions options;
  options.isovalue = a.has_isovalue ? a.isovalue : default_isovalue(v.type);
  options.normals = a.normals;
  options.drop_degenerate = a.drop_degenerate;
  options.cap = a.cap;
  if (a.trilinear) options.topology = Topology::trilinear;
  options.roi = lattice.box();

  gpu::DeviceVolume resident(lattice, bricks, 0);
  gpu::ResidentTuning tuning;
  tuning.brute_force = a.brute_force;
  std::optional<gpu::LaunchShape> shape;
  if (a.threads > 0) {
    shape = shape_with(a.threads, lattice.type, options);
    tuning.shape = &*shape;
  }
  gpu::ResidentExtractor extractor(resident, options, tuning);
  const gpu::DeviceCounts counts = extractor.extract(options.isovalue);
  nlohmann::json out;
  if (a.check || a.cpu) {
    Mesh expected, mesh;
    const double seconds = run_cpu(v, lattice, bricks, options, a.cpu ? a.runs : 1, expected);
    if (a.cpu) out["cpu_ms"] = seconds * 1e3;
    extractor.download(mesh);
    const bool same = same_bytes(expected.positions, mesh.positions) &&
                      same_bytes(expected.normals, mesh.normals) &&
                      same_bytes(expected.triangles, mesh.triangles);
    out["same_as_cpu"] = same;
    if (!same) fmt::print(stderr, "the mesh differs from the CPU's\n");
  }
  const std::vector<float> times = repeat_milliseconds(extractor, a.runs);
  const Bandwidth bandwidth = measure_bandwidth(std::size_t{1} << 30);
  const double read = static_cast<double>(counts.active_tiles) * 32768 *
                      static_cast<double>(lattice.sample_bytes());
  const double written =
      12.0 * static_cast<double>(counts.vertices * (a.normals ? 2 : 1) + counts.triangles);
  const double floor = (read / bandwidth.read + written / bandwidth.write) * 1e3;
  const float middle = median(times);
  const std::uint64_t extra_bytes = extractor.bytes();
  const double other = std::nextafter(options.isovalue, HUGE_VAL);
  const double wall = changed_isovalue_seconds(extractor, options.isovalue, other, a.runs) * 1e3;
  out["extent"] = {v.extent.x, v.extent.y, v.extent.z};
  out["type"] = short_name(v.type);
  out["isovalue"] = options.isovalue;
  out["normals"] = a.normals;
  out["brute_force"] = a.brute_force;
  out["vertices"] = counts.vertices;
  out["triangles"] = counts.triangles;
  out["active_tiles"] = counts.active_tiles;
  out["tiles"] = volume(lattice.tiles());
  out["ms_median"] = middle;
  out["ms_least"] = times.front();
  out["ms_most"] = times.back();
  out["wall_ms_median"] = wall;
  out["floor_ms"] = floor;
  out["times_floor"] = middle / floor;
  out["read_bytes_per_s"] = bandwidth.read;
  out["write_bytes_per_s"] = bandwidth.write;
  out["volume_device_bytes"] = resident.bytes();
  out["extra_device_bytes"] = extra_bytes;
  if (a.json)
    fmt::print("{}\n", out.dump());
  else
    fmt::print(
        "{}x{}x{} {} iso {}{}: {:.3f} ms (least {:.3f}), floor {:.3f}, x{:.2f}; {} triangles, "
        "{} of {} tiles{}{}\n",
        v.extent.x, v.extent.y, v.extent.z, short_name(v.type), options.isovalue,
        a.normals ? " normals" : "", middle, times.front(), floor, middle / floor, counts.triangles,
        counts.active_tiles, volume(lattice.tiles()),
        out.contains("cpu_ms") ? fmt::format(", cpu {:.2f} ms", out["cpu_ms"].get<double>()) : "",
        out.contains("same_as_cpu") ? out["same_as_cpu"].get<bool>() ? ", same" : ", DIFFERS" : "");
  return out.contains("same_as_cpu") && !out["same_as_cpu"].get<bool>() ? 1 : 0;
}

}  // namespace
}  // namespace isobrick::bench

int main(int argc, char** argv) {
  isobrick::bench::Arguments a;
  CLI::App app{"A resident volume to a mesh on the device"};
  app.add_option("--raw", a.raw, "a raw volume");
  app.add_option("--synth", a.synth, "a procedural field: sphere, gyroid, …");
  app.add_option("--dims", a.dims)->delimiter(',')->expected(3);
  app.add_option("--type", a.type, "of the procedural field");
  app.add_option("--frequency", a.frequency);
  app.add_option("--noise", a.noise);
  app.add_option("--isovalue", a.isovalue)->each([&](const std::string&) {
    a.has_isovalue = true;
  });
  app.add_option("--runs", a.runs)->check(CLI::PositiveNumber);
  app.add_option("--write-raw", a.write_raw, "also writes the volume");
  app.add_option("--threads", a.threads, "that share a tile; 0: as many as are best");
  app.add_flag("--normals", a.normals);
  app.add_flag("--drop-degenerate", a.drop_degenerate);
  app.add_flag("--trilinear", a.trilinear);
  app.add_flag("--cap", a.cap);
  app.add_flag("--brute-force", a.brute_force, "take every tile instead of searching");
  app.add_flag("--check", a.check, "compare with the CPU's mesh");
  app.add_flag("--cpu", a.cpu, "time the CPU as well");
  app.add_flag("--json", a.json);
  CLI11_PARSE(app, argc, argv);
  try {
    return isobrick::bench::run(a);
  } catch (const std::exception& error) {
    fmt::print(stderr, "gpu_resident: {}\n", error.what());
    return 1;
  }
}
