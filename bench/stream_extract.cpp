// A store to a mesh in host memory through the GPU, and to one left on the device, beside each of
// the stages alone.
//
//   isobrick synth gyroid g.zarr --dims 1024,1024,1024 --type u16
//   bench_stream_extract g.zarr --isovalue 32767.5 --gpu-memory 256M --memory 1G
//
// What the stages do alone is measured in the same run: reading the encoded bricks (from
// the page cache, where they fit it), reading and decoding them on all cores, copies of
// the same bytes up and down. After an extraction that sets the device up, extractions take turns
// with reading and decoding alone, so that what the machine does meanwhile meets both alike, and
// medians are compared. --check compares the mesh with the CPU's by a hash. With --cold
// the store is dropped from the page cache before each extraction, and before the reads alone.
// Built as in bench/README.md.

#include <cuda_runtime_api.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for_each.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include <isobrick/device_extractor.h>
#include <isobrick/error.h>
#include <isobrick/extract.h>
#include "bench/copies.h"
#include "bench/median.h"
#include "pipeline/extract/extract_plan.h"
#include "pipeline/workers.h"
#include "stream/tile_stream.h"

namespace isobrick::bench {
namespace {

using Clock = std::chrono::steady_clock;

double mebibytes(std::uint64_t bytes) { return static_cast<double>(bytes) / 1048576; }

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// Takes the mesh in host memory and hashes it on request.
class HashSink final : public MeshSink {
 public:
  explicit HashSink(bool hash) : hash_(hash) {}
  Indexing indexing() const override { return Indexing::welded; }
  void begin(const MeshHeader&) override {}
  void write(const MeshChunk& chunk) override {
    bytes_ +=
        chunk.positions.size_bytes() + chunk.normals.size_bytes() + chunk.triangles.size_bytes();
    if (!hash_) return;
    add(0, chunk.positions);
    add(1, chunk.normals);
    add(2, chunk.triangles);
  }
  void finish() override {}
  std::uint64_t bytes() const override { return bytes_; }
  const std::array<std::uint64_t, 3>& hashes() const { return sums_; }

 private:
  template <class V>
  void add(std::size_t stream, std::span<const V> values) {
    const auto* words = reinterpret_cast<const std::uint32_t*>(values.data());
    std::uint64_t sum = sums_[stream];
    for (std::size_t i = 0; i < values.size_bytes() / sizeof(*words); ++i)
      sum = (sum ^ words[i]) * 0x100000001b3ull;
    sums_[stream] = sum;
  }
  bool hash_;
  std::uint64_t bytes_ = 0;
  std::array<std::uint64_t, 3> sums_{};
};

struct Arguments {
  std::string store;
  ExtractOptions options;
  int turns = 3;
  bool check = false, cold = false, json = false;
};

std::vector<Int3> needed_bricks(const StoreReader& store, const ExtractOptions& options) {
  const ExtractRequest request = check_request(store, options, Indexing::welded);
  TileStream tiles(store, options.level, options.isovalue, request.surface.roi, request.search);
  const Lattice& lattice = request.level->lattice;
  BatchPlanner planner(tiles, lattice, sample_reach(request.surface), false, 1 << 14, 1 << 20);
  std::vector<bool> seen(static_cast<std::size_t>(volume(lattice.bricks())));
  std::vector<Int3> bricks;
  for (TileBatch batch; planner.next(batch);)
    for (const Int3 b : batch.bricks) {
      auto is_seen = seen[static_cast<std::size_t>(linear_index(b, lattice.bricks()))];
      if (!is_seen) bricks.push_back(b);
      is_seen = true;
    }
  return bricks;
}

/// Drops the store's files from the page cache.
void drop_from_cache(const std::string& store) {
  for (const auto& entry : std::filesystem::recursive_directory_iterator(store)) {
    if (!entry.is_regular_file()) continue;
    const int file = open(entry.path().c_str(), O_RDONLY | O_CLOEXEC);
    const bool dropped =
        file >= 0 && fsync(file) == 0 && posix_fadvise(file, 0, 0, POSIX_FADV_DONTNEED) == 0;
    if (file >= 0) close(file);
    if (!dropped) throw Error("'" + entry.path().string() + "' cannot be dropped from the cache");
  }
}

/// Reading alone, on all cores.
double read_alone(const StoreReader& store, int level, const std::vector<Int3>& bricks) {
  const std::filesystem::path folder = store.storage()->local_path();
  std::map<std::string, int> files;
  struct Piece {
    int file;
    BrickLocation at;
  };
  std::vector<Piece> pieces;
  std::uint64_t most = 0;
  for (const Int3 b : bricks)
    if (const auto at = store.locate(level, b)) {
      auto [file, added] = files.try_emplace(at->key, -1);
      if (added) file->second = open((folder / at->key).c_str(), O_RDONLY | O_CLOEXEC);
      pieces.push_back({file->second, *at});
      most = std::max(most, at->size);
    }
  tbb::enumerable_thread_specific<std::vector<std::byte>> buffers(
      [&] { return std::vector<std::byte>(most); });
  const auto start = Clock::now();
  tbb::parallel_for_each(pieces, [&](const Piece& piece) {
    if (pread(piece.file, buffers.local().data(), piece.at.size,
              static_cast<off_t>(piece.at.offset)) != static_cast<ssize_t>(piece.at.size))
      throw Error("a brick cannot be read");
  });
  const double seconds = seconds_since(start);
  for (const auto& [name, file] : files) close(file);
  return seconds;
}

/// Reading and decoding, on all cores.
double decode_alone(const StoreReader& store, int level, const std::vector<Int3>& bricks) {
  const std::size_t bytes =
      store.info().levels[static_cast<std::size_t>(level)].lattice.brick_bytes();
  tbb::enumerable_thread_specific<std::vector<std::byte>> buffers(
      [&] { return std::vector<std::byte>(bytes); });
  const auto start = Clock::now();
  tbb::parallel_for_each(bricks,
                         [&](Int3 b) { (void)store.read_brick(level, b, buffers.local().data()); });
  return seconds_since(start);
}

/// Extractions and stages alone, in turns.
struct Measured {
  double first_seconds = 0;  ///< the device's setting up included
  std::vector<ExtractReport> reports;
  std::map<std::string, std::vector<double>> seconds;

  /// The report of the extraction that took the median.
  const ExtractReport& report() const {
    const double middle = median(seconds.at("whole"));
    return *std::find_if(reports.begin(), reports.end(),
                         [&](const ExtractReport& r) { return r.seconds == middle; });
  }
};

/// The same with the mesh left on the device, until it is whole.
double extract_to_device_once(const StoreReader& store, const Arguments& a) {
  if (a.cold) drop_from_cache(a.store);
  const auto start = Clock::now();
  const DeviceMesh mesh = extract_to_device(store, a.options);
  if (cudaEventSynchronize(mesh.ready()) != cudaSuccess) throw Error("the device failed");
  return seconds_since(start);
}

Measured measure(const StoreReader& store, const Arguments& a, const std::vector<Int3>& bricks) {
  Measured measured;
  Workers workers(a.options.threads);
  const auto extract_once = [&] {
    NoProgress silent;
    HashSink sink(false);
    if (a.cold) drop_from_cache(a.store);
    return extract(store, a.options, sink, silent);
  };
  measured.first_seconds = extract_once().seconds;
  for (int turn = 0; turn < a.turns; ++turn) {
    measured.reports.push_back(extract_once());
    measured.seconds["whole"].push_back(measured.reports.back().seconds);
    measured.seconds["to_device"].push_back(extract_to_device_once(store, a));
    if (a.cold) drop_from_cache(a.store);
    workers.execute([&] {
      measured.seconds["read"].push_back(read_alone(store, a.options.level, bricks));
      measured.seconds["decode"].push_back(decode_alone(store, a.options.level, bricks));
    });
  }
  return measured;
}

int run(Arguments a) {
  const StoreReader store(a.store);
  a.options.backend = Backend::cuda;
  NoProgress silent;
  const std::vector<Int3> bricks = needed_bricks(store, a.options);
  nlohmann::ordered_json out{{"store", a.store}, {"bricks", bricks.size()}};

  const Measured measured = measure(store, a, bricks);
  const ExtractReport& r = measured.report();
  std::map<std::string, double> alone{{"read", median(measured.seconds.at("read"))},
                                      {"decode", median(measured.seconds.at("decode"))}};
  const std::uint64_t launches = std::max<std::uint64_t>(r.launches, 1);
  alone["upload"] = copy_seconds(r.upload.bytes, r.upload.bytes / launches, true);
  alone["download"] = copy_seconds(r.download.bytes, r.download.bytes / launches, false);
  // By events, beside the copies to a pool: alone they take no longer.
  alone["kernel"] = r.gather.seconds + r.kernel.seconds;
  const auto slowest = std::max_element(
      alone.begin(), alone.end(), [](const auto& l, const auto& n) { return l.second < n.second; });
  // What was dropped is decoded again.
  const double decode = alone["decode"] * static_cast<double>(r.brick_reads) /
                        static_cast<double>(std::max<std::uint64_t>(r.bricks_read, 1));
  const double to_device = median(measured.seconds.at("to_device"));
  // As if nothing passed before the first brick and after the last. What the plan takes is not
  // added: decoding begins inside of it.
  const double prediction = std::max(decode, slowest->second);

  out["seconds"] = r.seconds;
  out["first_seconds"] = measured.first_seconds;
  for (const auto& [name, seconds] : measured.seconds) out["turns"][name] = seconds;
  out["to_device_seconds"] = to_device;
  out["plan_seconds"] = r.plan_seconds;
  out["wait_seconds"] = {{"bricks", r.decode_seconds}, {"gpu", r.surface_seconds}};
  out["prediction"] = prediction;
  out["slowest_alone"] = slowest->first;
  out["ratio"] = slowest->second / r.seconds;
  for (const auto& [name, seconds] : alone) out["alone"][name] = seconds;
  for (const auto& [name, stage] : stages_of(r))
    out["busy"][std::string(name)] = {{"seconds", stage.seconds}, {"bytes", stage.bytes}};
  out["triangles"] = r.triangles;
  out["brick_reads"] = r.brick_reads;
  out["bricks_read"] = r.bricks_read;
  out["launches"] = r.launches;
  out["device_bytes"] = r.device_bytes;
  out["device_bytes_in_use"] = r.device_bytes_in_use;
  out["pinned_bytes"] = r.pinned_bytes;
  out["pool_bricks"] = r.pool_bricks;
  if (a.check) {
    HashSink gpu(true), cpu(true);
    extract(store, a.options, gpu, silent);
    a.options.backend = Backend::cpu;
    extract(store, a.options, cpu, silent);
    HashSink none(false);
    out["cpu_seconds"] = extract(store, a.options, none, silent).seconds;
    out["same_as_cpu"] = gpu.hashes() == cpu.hashes() && gpu.bytes() == cpu.bytes();
  }
  if (a.json) {
    fmt::print("{}\n", out.dump());
  } else {
    fmt::print(
        "{} triangles in {:.4f} s (first {:.3f}), predicted {:.4f}; slowest alone: {} {:.4f}, "
        "ratio {:.2f}; left on the device in {:.4f} s\n",
        r.triangles, r.seconds, measured.first_seconds, prediction, slowest->first, slowest->second,
        slowest->second / r.seconds, to_device);
    fmt::print(
        "  of that {:.3f} s to plan, {:.3f} waiting for bricks, {:.3f} for the GPU to take them; "
        "{} bricks read {} times; {} launches; {:.1f} MiB of device "
        "memory, {:.1f} page-locked{}\n",
        r.plan_seconds, r.decode_seconds, r.surface_seconds, r.bricks_read, r.brick_reads,
        r.launches, mebibytes(r.device_bytes), mebibytes(r.pinned_bytes),
        a.check ? fmt::format("; the CPU alone {:.3f} s, {}", out["cpu_seconds"].get<double>(),
                              out["same_as_cpu"].get<bool>() ? "same mesh" : "OTHER MESH")
                : "");
    for (const auto& [name, stage] : stages_of(r))
      fmt::print(
          "  {:9} busy {:.3f} s, {:8.1f} MiB, alone {}\n", name, stage.seconds,
          mebibytes(stage.bytes),
          alone.count(std::string(name)) ? fmt::format("{:.3f}", alone[std::string(name)]) : "-");
  }
  return out.value("same_as_cpu", true) ? 0 : 1;
}

}  // namespace
}  // namespace isobrick::bench

int main(int argc, char** argv) {
  isobrick::bench::Arguments a;
  CLI::App app{"A store to a mesh through the GPU, beside its stages alone"};
  app.add_option("store", a.store)->required();
  app.add_option("--isovalue", a.options.isovalue)->required();
  app.add_option("--memory", a.options.memory)->transform(CLI::AsSizeValue(false));
  app.add_option("--gpu-memory", a.options.gpu_memory)->transform(CLI::AsSizeValue(false));
  app.add_option("--threads", a.options.threads);
  app.add_flag("--normals", a.options.normals);
  app.add_option("--turns", a.turns, "extractions, besides the first")->check(CLI::PositiveNumber);
  app.add_flag("--check", a.check, "compare with the CPU's mesh");
  app.add_flag("--cold", a.cold, "drop the store from the page cache before each run");
  app.add_flag("--json", a.json);
  CLI11_PARSE(app, argc, argv);
  try {
    return isobrick::bench::run(a);
  } catch (const std::exception& error) {
    fmt::print(stderr, "bench_stream_extract: {}\n", error.what());
    return 1;
  }
}
