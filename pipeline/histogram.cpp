#include <isobrick/histogram.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include <isobrick/error.h>
#include "pipeline/program_memory.h"
#include "pipeline/slab_reader.h"

namespace isobrick {
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

/// Calls f(value, times) for every sample of a level, brick by brick; damaged(what) for a brick
/// that cannot be read.
template <class F, class Damaged>
void for_each_sample(const StoreReader& store, int level, Progress& progress, F&& f,
                     Damaged&& damaged) {
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  const Int3 bricks = lattice.bricks();
  std::vector<std::byte> samples(lattice.brick_bytes());
  progress.begin("histogram",
                 static_cast<std::uint64_t>(volume(lattice.extent)) * lattice.sample_bytes());
  for_each_point({{0, 0, 0}, bricks}, [&](Int3 b) {
    const Int3 extent = lattice.brick_box(b).extent();
    bool present = false, readable = true;
    try {
      present = store.read_brick(level, b, samples.data());
    } catch (const Error& error) {
      damaged(error);
      readable = false;
    }
    if (readable && !present)
      f(store.info().fill_value, static_cast<std::uint64_t>(volume(extent)));
    else if (readable)
      visit_scalar(lattice.type, [&](auto tag) {
        using T = typename decltype(tag)::type;
        for_each_point({{0, 0, 0}, extent}, [&](Int3 p) {
          T value;
          std::memcpy(
              &value,
              samples.data() + static_cast<std::size_t>(linear_index(p, lattice.brick)) * sizeof(T),
              sizeof(T));
          f(static_cast<double>(value), std::uint64_t{1});
        });
      });
    progress.advance(static_cast<std::uint64_t>(volume(extent)) * lattice.sample_bytes());
  });
  progress.end();
}

/// Bins of equal width from lo to hi; whole numbers get bins of whole width.
void lay_bins(Histogram& h, bool whole_numbers, int max_bins) {
  if (h.hi < h.lo) return;
  const double span = h.hi - h.lo;
  if (whole_numbers) {
    h.bin_width = std::ceil((span + 1) / max_bins);
    h.counts.resize(static_cast<std::size_t>(std::floor(span / h.bin_width)) + 1);
  } else {
    // Halved first: the span of doubles may itself be no finite number.
    h.bin_width = h.hi / max_bins - h.lo / max_bins;
    h.counts.resize(h.bin_width > 0 ? static_cast<std::size_t>(max_bins) : 1);
  }
}

std::size_t bin_of(const Histogram& h, double value) {
  if (h.counts.size() == 1) return 0;
  // The difference of whole numbers is exact, and so are their bins' bounds; that of doubles
  // may itself be no finite number.
  const double span = value - h.lo;
  const double at = span <= std::numeric_limits<double>::max()
                        ? span / h.bin_width
                        : value / h.bin_width - h.lo / h.bin_width;
  return std::min(static_cast<std::size_t>(std::max(at, 0.0)), h.counts.size() - 1);
}

}  // namespace

std::string why_no_histogram(const StoreReader& store, std::uint64_t memory) {
  const int level = choose_level(store.info());
  const LevelInfo& info = store.info().levels[static_cast<std::size_t>(level)];
  const Index shards = volume(ceil_div(info.lattice.extent, info.shard));
  if (shards > kMaxLookups)
    return fmt::format("level {} has {} chunk files; at most {} are looked for", level, shards,
                       kMaxLookups);
  const std::uint64_t bytes =
      kProgramBytes + slab_memory(store.info(), level, 1) + info.lattice.brick_bytes();
  if (bytes > memory)
    return fmt::format("a chunk of level {} takes {} MiB of memory", level, (bytes >> 20) + 1);
  return "";
}

Histogram histogram(const StoreReader& store, Progress& progress, int max_bins, bool leaves_out) {
  Histogram h;
  h.level = choose_level(store.info());
  ValueRange<double> range;
  for_each_sample(
      store, h.level, progress,
      [&](double value, std::uint64_t times) {
        if (std::isfinite(value))
          range.include(value);
        else
          (std::isnan(value) ? h.not_a_number : h.infinite) += times;
      },
      [&](const Error& error) {
        if (!leaves_out) throw;
        if (h.left_out++ == 0) h.damage = error.what();
      });
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(h.level)].lattice;
  if (h.left_out == static_cast<std::uint64_t>(volume(lattice.bricks()))) throw Error(h.damage);
  h.lo = range.lo;
  h.hi = range.hi;
  lay_bins(h, !is_floating(store.info().type), max_bins);
  for_each_sample(
      store, h.level, progress,
      [&](double value, std::uint64_t times) {
        if (std::isfinite(value) && !h.counts.empty()) h.counts[bin_of(h, value)] += times;
      },
      [](const Error&) {});
  return h;
}

}  // namespace isobrick
