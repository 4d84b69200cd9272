#include "pipeline/histogram/histogram.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include <isobrick/histogram.h>
#include "bricks/ranges/stored_ranges.h"
#include "pipeline/index/value_counts.h"
#include "pipeline/program_memory.h"
#include "pipeline/slab_reader.h"

namespace isobrick::inline v0 {
namespace {

constexpr Index kMaxSamples = Index{1} << 24;

int choose_level(const StoreInfo& info) {
  const auto small = [](const LevelInfo& level) {
    return volume(level.lattice.extent) <= kMaxSamples;
  };
  const auto found = std::find_if(info.levels.begin(), info.levels.end(), small);
  return static_cast<int>(std::min<std::ptrdiff_t>(
      found - info.levels.begin(), static_cast<std::ptrdiff_t>(info.levels.size()) - 1));
}

/// Counts the samples of a level, brick by brick; damaged(what) for a brick that cannot be read.
template <class Damaged>
SampleCounts count_level(const StoreReader& reader, int level, Progress& progress,
                         const Damaged& damaged) {
  const StoreReader store = reader.native();
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  const auto counts = make_value_counts(lattice.type);
  std::vector<std::byte> samples(lattice.brick_bytes());
  progress.begin("histogram",
                 static_cast<std::uint64_t>(volume(lattice.extent)) * lattice.sample_bytes());
  for_each_point({{0, 0, 0}, lattice.bricks()}, [&](Int3 b) {
    const Box3 box = lattice.brick_box(b);
    const auto count = static_cast<std::uint64_t>(volume(box.extent()));
    try {
      if (store.read_brick(level, b, samples.data()))
        counts->add(samples.data(), lattice.full_brick_box(b), box);
      else
        counts->add(store.info().fill_value, count);
    } catch (const Error& error) {
      damaged(error);
    }
    progress.advance(count * lattice.sample_bytes());
  });
  progress.end();
  return counts->counts();
}

}  // namespace

Histogram histogram_of(SampleCounts&& counts, ScalarType type) {
  const HistogramBins& bins = counts.bins;
  Histogram h;
  h.whole_numbers = !is_floating(type);
  h.not_a_number = bins.not_a_number;
  h.infinite = bins.infinite;
  h.counts = std::move(counts.counts);
  if (h.counts.empty()) return h;
  h.lo = bins.lo;
  h.hi = bins.hi;
  h.bin_width = std::ldexp(1.0, bins.exponent);
  // The first bin of the least doubles begins below all of them.
  h.first = std::max(std::ldexp(static_cast<double>(bins.first), bins.exponent),
                     std::numeric_limits<double>::lowest());
  return h;
}

std::string why_no_histogram(const StoreReader& store, std::uint64_t memory) {
  const int level = choose_level(store.info());
  const LevelInfo& info = store.info().levels[static_cast<std::size_t>(level)];
  const Index shards = volume(ceil_div(info.lattice.extent, info.shard));
  if (shards > kMaxLookups)
    return fmt::format("level {} has {} chunk files; at most {} are looked for", level, shards,
                       kMaxLookups);
  const std::uint64_t bytes = kProgramBytes + slab_memory(store.info(), level, 1) +
                              info.lattice.brick_bytes() + value_counts_bytes(info.lattice.type, 1);
  if (bytes > memory)
    return fmt::format("a chunk of level {} takes {} MiB of memory", level, (bytes >> 20) + 1);
  return "";
}

std::optional<SampleCounts> stored_counts(const StoreReader& store) {
  const StoreInfo& info = store.info();
  const auto ranges = read_stored_ranges(*store.storage(), info.additions);
  if (!ranges || !ranges->histogram || ranges->image_crc32c != info.metadata_crc32c)
    return std::nullopt;
  return read_histogram(*store.storage(), histogram_folder(info.additions), *ranges->histogram,
                        static_cast<std::uint64_t>(volume(info.levels.front().lattice.extent)));
}

std::optional<Histogram> stored_histogram(const StoreReader& store) {
  auto stored = stored_counts(store);
  if (!stored) return std::nullopt;
  return histogram_of(std::move(*stored), surface_type(store.info().type));
}

Histogram histogram(const StoreReader& store, Progress& progress, int max_bins, bool leaves_out) {
  if (const auto stored = stored_histogram(store)) return rebin(*stored, max_bins);
  const int level = choose_level(store.info());
  std::uint64_t left_out = 0;
  std::string damage;
  SampleCounts counts = count_level(store, level, progress, [&](const Error& error) {
    if (!leaves_out) throw;
    if (left_out++ == 0) damage = error.what();
  });
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  if (left_out == static_cast<std::uint64_t>(volume(lattice.bricks()))) throw Error(damage);
  Histogram h = rebin(histogram_of(std::move(counts), surface_type(lattice.type)), max_bins);
  h.level = level;
  h.left_out = left_out;
  h.damage = std::move(damage);
  return h;
}

}  // namespace isobrick
