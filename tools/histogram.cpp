#include "tools/histogram.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include <fmt/format.h>

#include "isobrick/core/error.h"

namespace isobrick::tools {
namespace {

constexpr Index kMostSamples = Index{1} << 24;
constexpr int kMostBins = 64;

int choose_level(const StoreInfo& info) {
  const auto small = [](const LevelInfo& level) {
    return volume(level.lattice.extent) <= kMostSamples;
  };
  const auto found = std::find_if(info.levels.begin(), info.levels.end(), small);
  return static_cast<int>(std::min<std::ptrdiff_t>(
      found - info.levels.begin(), static_cast<std::ptrdiff_t>(info.levels.size()) - 1));
}

/// Calls f(value, times) for every sample of a level, brick by brick.
template <class F>
void for_each_sample(const StoreReader& store, int level, Progress& progress, F&& f) {
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  const Int3 bricks = lattice.bricks();
  std::vector<std::byte> samples(lattice.brick_bytes());
  progress.begin("histogram",
                 static_cast<std::uint64_t>(volume(lattice.extent)) * lattice.sample_bytes());
  for_each_point({{0, 0, 0}, bricks}, [&](Int3 b) {
    const Int3 extent = lattice.brick_box(b).extent();
    if (!store.read_brick(level, b, samples.data()))
      f(store.info().fill_value, static_cast<std::uint64_t>(volume(extent)));
    else
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
void lay_bins(Histogram& h, bool whole_numbers) {
  if (h.hi < h.lo) return;
  const double span = h.hi - h.lo;
  if (whole_numbers) {
    h.bin_width = std::ceil((span + 1) / kMostBins);
    h.counts.resize(static_cast<std::size_t>(std::floor(span / h.bin_width)) + 1);
  } else {
    // Halved first: the span of doubles may itself be no finite number.
    h.bin_width = h.hi / kMostBins - h.lo / kMostBins;
    h.counts.resize(h.bin_width > 0 ? kMostBins : 1);
  }
}

std::size_t bin_of(const Histogram& h, double value) {
  if (h.counts.size() == 1) return 0;
  const double at = value / h.bin_width - h.lo / h.bin_width;
  return std::min(static_cast<std::size_t>(std::max(at, 0.0)), h.counts.size() - 1);
}

/// Height of a column in eighths of a character.
int height_of(std::uint64_t count, std::uint64_t most, int rows) {
  if (count == 0) return 0;
  const double part = std::sqrt(static_cast<double>(count) / static_cast<double>(most));
  return std::max(1, static_cast<int>(std::lround(part * rows * 8)));
}

}  // namespace

Histogram histogram(const StoreReader& store, Progress& progress) {
  Histogram h;
  h.level = choose_level(store.info());
  ValueRange<double> range;
  for_each_sample(store, h.level, progress, [&](double value, std::uint64_t times) {
    if (std::isfinite(value))
      range.include(value);
    else
      (std::isnan(value) ? h.not_a_number : h.infinite) += times;
  });
  h.lo = range.lo;
  h.hi = range.hi;
  lay_bins(h, !is_floating(store.info().type));
  for_each_sample(store, h.level, progress, [&](double value, std::uint64_t times) {
    if (std::isfinite(value)) h.counts[bin_of(h, value)] += times;
  });
  return h;
}

std::string draw(const Histogram& h, int rows) {
  if (h.counts.empty()) return "no finite sample\n";
  constexpr std::array<const char*, 9> blocks{" ", "▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
  const std::uint64_t most = *std::max_element(h.counts.begin(), h.counts.end());
  std::string text;
  for (int row = rows - 1; row >= 0; --row) {
    text += "  ";
    for (const std::uint64_t count : h.counts)
      text += blocks[static_cast<std::size_t>(
          std::clamp(height_of(count, most, rows) - 8 * row, 0, 8))];
    text += '\n';
  }
  const std::string lo = fmt::format("{:g}", h.lo), hi = fmt::format("{:g}", h.hi);
  const std::size_t gap =
      h.counts.size() > lo.size() + hi.size() ? h.counts.size() - lo.size() - hi.size() : 1;
  return text + "  " + lo + std::string(gap, ' ') + hi + '\n';
}

}  // namespace isobrick::tools
