// An array in device memory to a mesh in device memory, ranges included, beside the time that
// reading the array and writing the mesh take at the memory's speed.
//
//   bench_device_arrays --synth gyroid --dims 1024,1024,1024 --type u8 --json
//   bench_device_arrays --synth sphere --type f64 --layout fortran
//
// Correctness first: the mesh is compared with the CPU's, byte for byte.
// Built as in bench/README.md.

#include <cuda_runtime_api.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include <isobrick/device_extractor.h>
#include <isobrick/error.h>
#include <isobrick/synth_source.h>
#include <isobrick/volume_extractor.h>
#include "bench/bandwidth.h"
#include "bench/median.h"
#include "bench/volume.h"
#include "gpu/memory/cuda_check.h"
#include "gpu/memory/device_buffer.h"

namespace isobrick::bench {
namespace {

struct Arguments {
  std::string synth = "gyroid", type = "u8", layout = "c";
  std::vector<Index> dims{512, 512, 512};
  std::optional<double> isovalue;
  double frequency = 0;
  bool normals = false, json = false;
  int runs = 15;
};

Volume make_volume(const Arguments& a) {
  const auto kind = parse_synth_kind(a.synth);
  const auto type = parse_scalar_type(a.type);
  if (!kind || !type) throw UsageError("give a --synth and a --type that exist");
  SynthOptions options;
  options.kind = *kind;
  options.extent = {a.dims[0], a.dims[1], a.dims[2]};
  options.type = *type;
  if (a.frequency > 0) options.frequency = a.frequency;
  return read_all(*make_synth(options));
}

/// Of the samples in memory, bytes along x, y, z.
Int3 strides_of(const std::string& layout, Int3 extent, Index bytes) {
  if (layout == "c") return {bytes, bytes * extent.x, bytes * extent.x * extent.y};
  if (layout == "fortran") return {bytes * extent.z * extent.y, bytes * extent.z, bytes};
  if (layout == "second") return {2 * bytes, 2 * bytes * extent.x, 2 * bytes * extent.x * extent.y};
  throw UsageError("--layout takes c, fortran or second (every second sample)");
}

std::vector<std::byte> laid_out(const Volume& v, Int3 strides) {
  const auto bytes = static_cast<Index>(size_of(v.type));
  const Int3 last = v.extent - Int3{1, 1, 1};
  std::vector<std::byte> memory(static_cast<std::size_t>(dot(last, strides) + bytes + 16));
  tbb::parallel_for(Index{0}, v.extent.z, [&](Index z) {
    const std::byte* from = v.samples.data() + z * v.extent.x * v.extent.y * bytes;
    for (Index y = 0; y < v.extent.y; ++y)
      for (Index x = 0; x < v.extent.x; ++x, from += bytes)
        std::memcpy(memory.data() + dot(Int3{x, y, z}, strides), from,
                    static_cast<std::size_t>(bytes));
  });
  return memory;
}

void wait_for(const DeviceMesh& mesh) {
  if (mesh.ready()) gpu::check(cudaEventSynchronize(mesh.ready()));
}

/// Milliseconds of `work` until its mesh is whole.
template <class F>
double milliseconds(int runs, F&& work) {
  using Clock = std::chrono::steady_clock;
  std::vector<double> times;
  for (int i = 0; i < runs; ++i) {
    const auto start = Clock::now();
    work();
    times.push_back(std::chrono::duration<double, std::milli>(Clock::now() - start).count());
  }
  return median(times);
}

template <class V>
bool same_bytes(const PodBuffer<V>& a, const PodBuffer<V>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(V)) == 0;
}

bool same_as_cpu(const Volume& v, const ExtractOptions& options, const Mesh& mesh) {
  isobrick::Volume volume;
  volume.samples = v.samples.data();
  volume.type = v.type;
  volume.extent = v.extent;
  const Mesh expected = extract(volume, options);
  return same_bytes(expected.positions, mesh.positions) &&
         same_bytes(expected.normals, mesh.normals) &&
         same_bytes(expected.triangles, mesh.triangles);
}

int run(const Arguments& a) {
  const Volume v = make_volume(a);
  const auto bytes = static_cast<Index>(size_of(v.type));
  DeviceArray array;
  array.type = v.type;
  array.extent = v.extent;
  array.strides = strides_of(a.layout, v.extent, bytes);
  const std::vector<std::byte> memory = laid_out(v, array.strides);
  const gpu::DeviceBuffer<std::byte> samples(memory.size());
  gpu::check(cudaMemcpy(samples.data(), memory.data(), memory.size(), cudaMemcpyHostToDevice));
  array.samples = samples.data();
  const gpu::Stream stream;
  array.stream = stream.get();
  ExtractOptions options;
  options.isovalue = a.isovalue.value_or(default_isovalue(v.type));
  options.normals = a.normals;

  DeviceExtractor extractor(array);
  const DeviceMesh mesh = extractor.extract(options);
  const bool same = same_as_cpu(v, options, mesh.download());
  // The pool is warm: `mesh` keeps it, and a call leaves its memory there.
  wait_for(extract(array, options));
  const double call = milliseconds(a.runs, [&] { wait_for(extract(array, options)); });
  const double copy = milliseconds(a.runs, [&] { DeviceExtractor again(array); });
  const double later = milliseconds(a.runs, [&] { wait_for(extractor.extract(options)); });
  const Bandwidth bandwidth = measure_bandwidth(std::size_t{1} << 30);
  const double read_floor = static_cast<double>(v.samples.size()) / bandwidth.read * 1e3;
  const double mesh_floor =
      static_cast<double>(mesh.positions().size_bytes() + mesh.normals().size_bytes() +
                          mesh.triangles().size_bytes()) /
      bandwidth.write * 1e3;
  const double floor = read_floor + mesh_floor;
  if (a.json)
    fmt::print("{}\n", nlohmann::json{{"extent", {v.extent.x, v.extent.y, v.extent.z}},
                                      {"type", short_name(v.type)},
                                      {"layout", a.layout},
                                      {"triangles", mesh.triangles().size()},
                                      {"read_floor_ms", read_floor},
                                      {"floor_ms", floor},
                                      {"call_ms", call},
                                      {"copy_ms", copy},
                                      {"later_ms", later},
                                      {"same_as_cpu", same}}
                           .dump());
  else
    fmt::print(
        "{} {}x{}x{} {} {}: {} triangles, {}; floor {:.3f} ms (array {:.3f}), call {:.3f} ms "
        "(x{:.2f}), "
        "copy and ranges {:.3f}, later isovalue {:.3f}\n",
        a.synth, v.extent.x, v.extent.y, v.extent.z, short_name(v.type), a.layout,
        mesh.triangles().size(), same ? "same" : "DIFFERS", floor, read_floor, call, call / floor,
        copy, later);
  return same ? 0 : 1;
}

}  // namespace
}  // namespace isobrick::bench

int main(int argc, char** argv) {
  isobrick::bench::Arguments a;
  CLI::App app{"An array in device memory to a mesh on the device"};
  app.add_option("--synth", a.synth, "a procedural field: sphere, gyroid, …");
  app.add_option("--dims", a.dims)->delimiter(',')->expected(3);
  app.add_option("--type", a.type);
  app.add_option("--layout", a.layout, "c, fortran or second");
  app.add_option("--frequency", a.frequency);
  app.add_option("--isovalue", a.isovalue);
  app.add_option("--runs", a.runs)->check(CLI::PositiveNumber);
  app.add_flag("--normals", a.normals);
  app.add_flag("--json", a.json);
  CLI11_PARSE(app, argc, argv);
  try {
    return isobrick::bench::run(a);
  } catch (const std::exception& error) {
    fmt::print(stderr, "bench_device_arrays: {}\n", error.what());
    return 1;
  }
}
