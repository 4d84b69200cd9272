// How much shorter and how much faster than zstd packed bricks are, on one core and on a GPU.
//
//   bench_packed --raw engine_256x256x128_uint8.raw
//   bench_packed --synth gyroid --frequency 6 --noise 0 --dims 256,256,256 --type u8 --gpu
//
// Every decoded brick is compared. Built as in bench/README.md.

#include <fmt/format.h>
#include <zstd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstring>
#include <vector>

#include <isobrick/error.h>
#include <isobrick/synth_source.h>
#include "bench/guarded_main.h"
#include "bench/median.h"
#include "bench/packed_on_device.h"
#include "bench/volume.h"
#include "packed/packed_brick.h"

namespace isobrick::bench {
namespace {

using Clock = std::chrono::steady_clock;
using Bytes = std::vector<std::byte>;

constexpr Int3 kBrick{64, 64, 64};

/// The bricks of a volume, but those of nothing but zeros; what they lack of the volume is zero.
std::vector<Bytes> cut(const Volume& v) {
  const std::size_t size = size_of(v.type);
  std::vector<Bytes> bricks;
  const Int3 grid = ceil_div(v.extent, kBrick);
  for (Index i = 0; i < volume(grid); ++i) {
    const Int3 b = point_at(i, grid);
    const Box3 box = intersect({b * kBrick, (b + Int3{1, 1, 1}) * kBrick}, {{}, v.extent});
    Bytes brick(static_cast<std::size_t>(volume(kBrick)) * size);
    for (Index z = box.lo.z; z < box.hi.z; ++z)
      for (Index y = box.lo.y; y < box.hi.y; ++y) {
        const Int3 row{box.lo.x, y, z};
        std::memcpy(
            brick.data() + static_cast<std::size_t>(linear_index(row - b * kBrick, kBrick)) * size,
            v.samples.data() + static_cast<std::size_t>(linear_index(row, v.extent)) * size,
            static_cast<std::size_t>(box.extent().x) * size);
      }
    if (brick != Bytes(brick.size())) bricks.push_back(std::move(brick));
  }
  return bricks;
}

/// Differences along y, which is what zstd is given to be compared with.
Bytes along_y(ScalarType type, const Bytes& brick) {
  Bytes result(brick.size());
  visit_scalar(type, [&](auto tag) {
    constexpr std::size_t size = sizeof(typename decltype(tag)::type);
    using U = std::conditional_t<
        size == 1, std::uint8_t,
        std::conditional_t<size == 2, std::uint16_t,
                           std::conditional_t<size == 4, std::uint32_t, std::uint64_t>>>;
    const auto* const from = reinterpret_cast<const U*>(brick.data());
    auto* const to = reinterpret_cast<U*>(result.data());
    for (Index i = 0; i < volume(kBrick); ++i)
      to[i] = i / kBrick.x % kBrick.y == 0 ? from[i] : static_cast<U>(from[i] - from[i - kBrick.x]);
  });
  return result;
}

struct Zstd {
  std::size_t bytes = 0;
  double decode = 0;  ///< seconds
};

Zstd by_zstd(const std::vector<Bytes>& bricks) {
  Zstd result;
  Bytes packed(ZSTD_compressBound(bricks.front().size())), out(bricks.front().size());
  for (const Bytes& brick : bricks) {
    const std::size_t size =
        ZSTD_compress(packed.data(), packed.size(), brick.data(), brick.size(), 3);
    result.bytes += size;
    const auto start = Clock::now();
    ZSTD_decompress(out.data(), out.size(), packed.data(), size);
    result.decode += std::chrono::duration<double>(Clock::now() - start).count();
  }
  return result;
}

template <class F>
double median_seconds(const F& f) {
  std::vector<double> seconds;
  for (int run = 0; run < 5; ++run) {
    const auto start = Clock::now();
    f();
    seconds.push_back(std::chrono::duration<double>(Clock::now() - start).count());
  }
  return median(seconds);
}

void measure(const Volume& v, bool gpu) {
  const std::vector<Bytes> bricks = cut(v);
  if (bricks.empty()) throw Error("all samples are zero");
  std::vector<Bytes> packed(bricks.size());
  const double encode = median_seconds([&] {
    for (std::size_t i = 0; i < bricks.size(); ++i)
      packed[i] = pack_brick(v.type, kBrick, bricks[i]);
  });
  Bytes out(bricks.front().size());
  const double decode = median_seconds([&] {
    for (const Bytes& brick : packed) unpack_brick(v.type, kBrick, brick, out);
  });
  double bytes = 0, packed_bytes = 0;
  for (std::size_t i = 0; i < bricks.size(); ++i) {
    unpack_brick(v.type, kBrick, packed[i], out);
    if (out != bricks[i]) throw Error("the CPU decodes other samples");
    bytes += static_cast<double>(bricks[i].size());
    packed_bytes += static_cast<double>(packed[i].size());
  }
  const Zstd plain = by_zstd(bricks);
  std::vector<Bytes> differences;
  for (const Bytes& brick : bricks) differences.push_back(along_y(v.type, brick));
  const Zstd delta = by_zstd(differences);
  fmt::print("ratio: packed {:.2f}, zstd {:.2f}, differences and zstd {:.2f}\n",
             bytes / packed_bytes, bytes / static_cast<double>(plain.bytes),
             bytes / static_cast<double>(delta.bytes));
  fmt::print("one core, GB/s of samples: encode {:.2f}, decode {:.2f}; zstd decodes {:.2f}\n",
             1e-9 * bytes / encode, 1e-9 * bytes / decode, 1e-9 * bytes / plain.decode);
  if (!gpu) return;
#ifdef ISOBRICK_WITH_CUDA
  const auto copies = static_cast<std::size_t>(std::max(1.0, 2e9 / bytes));
  const double seconds = decode_on_device(v.type, kBrick, packed, bricks, copies);
  fmt::print("GPU, GB/s of samples: decode {:.0f}\n",
             1e-9 * bytes * static_cast<double>(copies) / seconds);
#else
  throw Error("built without CUDA");
#endif
}

int run(int argc, char** argv) {
  CLI::App app("bench_packed");
  std::string raw, synth, type = "u8", dims = "256,256,256";
  SynthOptions options;
  bool gpu = false;
  app.add_option("--raw", raw);
  app.add_option("--synth", synth);
  app.add_option("--dims", dims);
  app.add_option("--type", type);
  double frequency = 2;
  app.add_option("--frequency", frequency);
  app.add_option("--noise", options.noise);
  app.add_flag("--gpu", gpu);
  CLI11_PARSE(app, argc, argv);
  if (raw.empty() == synth.empty()) throw Error("either --raw or --synth");
  if (!raw.empty()) {
    measure(read_raw(raw), gpu);
    return 0;
  }
  long x = 0, y = 0, z = 0;
  if (std::sscanf(dims.c_str(), "%ld,%ld,%ld", &x, &y, &z) != 3) throw Error("--dims X,Y,Z");
  const auto kind = parse_synth_kind(synth);
  if (!kind) throw Error("no such field");
  options.kind = *kind;
  options.frequency = frequency;
  options.extent = {x, y, z};
  for (const ScalarType t : kScalarTypes)
    if (type == short_name(t)) options.type = t;
  measure(read_all(*make_synth(options)), gpu);
  return 0;
}

}  // namespace
}  // namespace isobrick::bench

int main(int argc, char** argv) {
  return isobrick::bench::guarded_main("bench_packed", isobrick::bench::run, argc, argv);
}
