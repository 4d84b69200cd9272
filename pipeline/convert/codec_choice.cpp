#include "pipeline/convert/codec_choice.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <limits>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>
#include <vector>

#include <isobrick/error.h>
#include <isobrick/pod_buffer.h>
#include "bricks/zarr/codec.h"
#include "bricks/zarr/json_reader.h"
#include "bricks/zarr/store_names.h"
#include "pipeline/convert/convert_cascade.h"

namespace isobrick::inline v0 {
namespace {

/// Bricks that are looked at together, and how often, until half as many are stored.
constexpr Index kBricksOfRound = 32, kMinBricksOfRound = 4;
constexpr int kRounds = 8;
constexpr std::size_t kBytesOfRound = std::size_t{64} << 20;

Index bricks_of_round(const Lattice& lattice) {
  return std::clamp(static_cast<Index>(kBytesOfRound / lattice.brick_bytes()), kMinBricksOfRound,
                    kBricksOfRound);
}

/// The i-th of a sequence that fills the unit cube evenly from its beginning: multiples of the
/// powers of the inverse of 1.2207…, the root of x⁴ = x + 1.
Int3 spread_brick(Index i, Int3 bricks) {
  constexpr std::array kSteps{0.8191725133961645, 0.6710436067037893, 0.5497004779019703};
  Int3 b;
  for (int axis = 0; axis < 3; ++axis) {
    const double at = 0.5 + static_cast<double>(i) * kSteps[static_cast<std::size_t>(axis)];
    const auto count = static_cast<double>(bricks[axis]);
    b[axis] = std::min(static_cast<Index>((at - std::floor(at)) * count), bricks[axis] - 1);
  }
  return b;
}

/// Different bricks in the order of that sequence; all of them where they are few.
std::vector<Int3> spread_bricks(Int3 bricks, Index wanted) {
  std::vector<Int3> found;
  if (volume(bricks) <= wanted) {
    for_each_point({{0, 0, 0}, bricks}, [&](Int3 b) { found.push_back(b); });
    return found;
  }
  std::set<Index> seen;
  for (Index i = 0; static_cast<Index>(found.size()) < wanted && i < 4 * wanted; ++i)
    if (const Int3 b = spread_brick(i, bricks); seen.insert(linear_index(b, bricks)).second)
      found.push_back(b);
  return found;
}

/// Of this thread: other work of the machine does not count.
double processor_seconds() {
  struct timespec now {};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// The least of some decodings: the first one finds memory that nobody has touched.
double decode_seconds(const CodecChain& chain, const Lattice& lattice,
                      std::span<const std::byte> encoded, std::span<std::byte> out) {
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 4; ++i) {
    const double begin = processor_seconds();
    decode_brick(chain, lattice, lattice.sample_bytes(), encoded, out);
    least = std::min(least, processor_seconds() - begin);
  }
  return least;
}

/// Of one brick; no brick where it holds the fill value only.
CodecSample sample_brick(const Lattice& lattice, const SampleValue& fill_value, int zstd_level,
                         std::span<std::byte> samples) {
  const CodecChain zstd = CodecChain::of(BrickCodec::zstd, zstd_level, false);
  const CodecChain packed = CodecChain::of(BrickCodec::packed, zstd_level, false);
  CodecSample sample;
  auto encoded = encode_brick(lattice, samples, fill_value, zstd);
  if (!encoded) return sample;
  sample.bricks = 1;
  sample.bytes = samples.size();
  sample.zstd_bytes = encoded->size();
  const auto as_packed = encode_brick(lattice, samples, fill_value, packed);
  sample.packed_bytes = as_packed->size();
  sample.zstd_seconds = decode_seconds(zstd, lattice, *encoded, samples);
  sample.packed_seconds = decode_seconds(packed, lattice, *as_packed, samples);
  return sample;
}

void add(CodecSample& sum, const CodecSample& brick) {
  sum.bricks += brick.bricks;
  sum.bytes += brick.bytes;
  sum.zstd_bytes += brick.zstd_bytes;
  sum.packed_bytes += brick.packed_bytes;
  sum.zstd_seconds += brick.zstd_seconds;
  sum.packed_seconds += brick.packed_seconds;
}

}  // namespace

CodecSample sample_bricks(const Lattice& lattice, const SampleValue& fill_value, int zstd_level,
                          const BrickRead& read) {
  const Index round = bricks_of_round(lattice);
  const std::vector<Int3> bricks = spread_bricks(lattice.bricks(), kRounds * round);
  CodecSample sum;
  std::mutex mutex;
  for (std::size_t begin = 0; begin < bricks.size(); begin += static_cast<std::size_t>(round)) {
    const std::size_t end = std::min(bricks.size(), begin + static_cast<std::size_t>(round));
    tbb::parallel_for(begin, end, [&](std::size_t i) {
      PodBuffer<std::byte> samples;
      samples.resize(lattice.brick_bytes());
      const std::span bytes(samples.data(), samples.size());
      if (!read(bricks[i], bytes)) return;
      const CodecSample brick = sample_brick(lattice, fill_value, zstd_level, bytes);
      const std::lock_guard lock(mutex);
      add(sum, brick);
    });
    if (2 * sum.bricks >= static_cast<std::uint64_t>(round)) break;
  }
  return sum;
}

namespace {

/// Rows of a few bricks along x: where a file has its planes compressed, a row costs no more than
/// one brick of it.
class RowSampler {
 public:
  RowSampler(VolumeSource& source, const StoreLayout& layout, std::uint64_t memory)
      : source_(source), layout_(layout), lattice_(layout.levels.front().lattice) {
    const std::uint64_t room = memory / 16 / lattice_.brick_bytes();
    length_ = std::min(static_cast<Index>(std::clamp<std::uint64_t>(room, 1, kMaxRow)),
                       lattice_.bricks().x);
  }

  CodecSample run();

 private:
  static constexpr std::uint64_t kMaxRow = 8;

  void add_row(Int3 row);
  CodecSample sample(Int3 b, Box3 box) const;

  VolumeSource& source_;
  const StoreLayout& layout_;
  const Lattice& lattice_;
  Index length_ = 1;  ///< bricks of a row
  PodBuffer<std::byte> samples_;
  CodecSample sum_;
};

CodecSample RowSampler::run() {
  const Int3 bricks = lattice_.bricks();
  const Index wanted = bricks_of_round(lattice_), round = ceil_div(wanted, length_);
  const Int3 rows{ceil_div(bricks.x, length_), bricks.y, bricks.z};
  const std::vector<Int3> chosen = spread_bricks(rows, kRounds * round);
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    add_row(chosen[i]);
    const bool round_ends = (i + 1) % static_cast<std::size_t>(round) == 0;
    if (round_ends && 2 * sum_.bricks >= static_cast<std::uint64_t>(wanted)) break;
  }
  return sum_;
}

void RowSampler::add_row(Int3 row) {
  const Int3 first{row.x * length_, row.y, row.z};
  const Index end = std::min(first.x + length_, lattice_.bricks().x);
  const Box3 box = intersect(
      {first * lattice_.brick, Int3{end, row.y + 1, row.z + 1} * lattice_.brick}, lattice_.box());
  if (source_.is_fill(box)) return;
  samples_.resize(static_cast<std::size_t>(volume(box.extent())) * lattice_.sample_bytes());
  read_box(source_, box, samples_.data());
  std::mutex mutex;
  tbb::parallel_for(first.x, end, [&](Index x) {
    const CodecSample brick = sample({x, row.y, row.z}, box);
    const std::lock_guard lock(mutex);
    add(sum_, brick);
  });
}

CodecSample RowSampler::sample(Int3 b, Box3 box) const {
  const Box3 full = lattice_.full_brick_box(b);
  PodBuffer<std::byte> brick;
  brick.resize(lattice_.brick_bytes());
  copy_box({samples_.data(), box}, {brick.data(), full}, lattice_.brick_box(b),
           lattice_.sample_bytes());
  pad_brick(lattice_, b, layout_.fill_value, brick.data());
  return sample_brick(lattice_, layout_.fill_value, layout_.zstd_level,
                      {brick.data(), brick.size()});
}

}  // namespace

CodecSample sample_source(VolumeSource& source, const StoreLayout& layout, int threads,
                          std::uint64_t memory) {
  tbb::task_arena arena(threads);
  return arena.execute([&] { return RowSampler(source, layout, memory).run(); });
}

BrickCodec better_codec(const CodecSample& sample, double factor) {
  const bool packed = sample.bricks > 0 && static_cast<double>(sample.packed_bytes) <=
                                               factor * static_cast<double>(sample.zstd_bytes);
  return packed ? BrickCodec::packed : BrickCodec::zstd;
}

std::size_t sampling_bytes(const Lattice& lattice, int zstd_level, int threads) {
  const std::size_t brick = lattice.brick_bytes();
  std::size_t bytes = 4 * brick;
  for (const BrickCodec codec : {BrickCodec::zstd, BrickCodec::packed})
    bytes += encoder_memory(CodecChain::of(codec, zstd_level, false), brick);
  return bytes * static_cast<std::size_t>(threads);
}

int sampling_threads(const Lattice& lattice, int zstd_level, std::uint64_t memory, int threads) {
  const std::uint64_t room = memory / 8 / sampling_bytes(lattice, zstd_level, 1);
  return static_cast<int>(std::clamp<std::uint64_t>(room, 1, static_cast<std::uint64_t>(threads)));
}

void check_codec(BrickCodec codec, int zstd_level, double packed_factor, OmeVersion ome) {
  if (zstd_level < 1 || zstd_level > 22)
    throw UsageError(fmt::format("zstd level {}: 1 to 22 are possible", zstd_level));
  if (!(packed_factor > 0) || !std::isfinite(packed_factor))
    throw UsageError(fmt::format("a factor of {}: it is a positive number", packed_factor));
  if (codec == BrickCodec::packed && ome == OmeVersion::v04)
    throw UsageError("the codec 'packed' needs OME-Zarr 0.5: 0.4 has no name for it");
}

void take_begun_codec(const std::filesystem::path& staging, StoreLayout& layout) {
  const std::filesystem::path marker = staging / kLayoutMarker;
  const auto text = read_small_file(marker, kMaxMetadataBytes);
  if (!text) return;  // what is wrong shows where the marker is compared
  const std::string where = quoted(marker);
  const nlohmann::json json = parse_json(*text, where);
  const std::string array = JsonReader(json, where).at("arrays").at(std::size_t{0}).raw().dump();
  const CodecChain codecs = parse_array_metadata(array, where).codecs;
  layout.codec = codecs.packed ? BrickCodec::packed : BrickCodec::zstd;
}

}  // namespace isobrick
