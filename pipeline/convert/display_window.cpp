#include "pipeline/convert/display_window.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "bricks/zarr/codec.h"

namespace isobrick::inline v0 {
namespace {

/// Samples that are read, but for bricks that are larger, and of these the ones that are kept.
constexpr Index kFewSamples = Index{1} << 21, kKept = Index{1} << 18;

/// The finest level of few samples, else the coarsest.
int level_of_few(const StoreInfo& info) {
  int level = 0;
  while (level + 1 < static_cast<int>(info.levels.size()) &&
         volume(info.levels[static_cast<std::size_t>(level)].lattice.extent) > kFewSamples)
    ++level;
  return level;
}

/// Adds every `step`-th finite sample of a brick, counting on over bricks by `count`.
template <class T>
void add_samples(const Lattice& lattice, Int3 b, const std::byte* brick, Index step, Index& count,
                 std::vector<double>& values) {
  const Box3 full = lattice.full_brick_box(b);
  for_each_point(lattice.brick_box(b), [&](Int3 p) {
    if (count++ % step != 0) return;
    T sample;
    std::memcpy(
        &sample,
        brick + sizeof(T) * static_cast<std::size_t>(linear_index(p - full.lo, lattice.brick)),
        sizeof sample);
    if (std::isfinite(static_cast<double>(sample))) values.push_back(static_cast<double>(sample));
  });
}

std::vector<double> some_samples(const StoreReader& reader) {
  const StoreReader store = reader.native();
  const int level = level_of_few(store.info());
  const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
  const Int3 bricks = lattice.bricks();
  // Odd, so that it does not meet every row of bricks at the same places.
  const Index samples = volume(lattice.extent);
  const Index nth_brick = std::min(samples / kFewSamples, volume(bricks) - 1) | 1;
  const Index step = ceil_div(samples / nth_brick, kKept);
  std::vector<std::byte> brick(lattice.brick_bytes());
  std::vector<double> values;
  Index count = 0;
  for (Index i = nth_brick / 2; i < volume(bricks); i += nth_brick) {
    const Int3 b = point_at(i, bricks);
    if (!store.read_brick(level, b, brick.data()))
      fill_box(lattice.type, store.info().fill_value, {brick.data(), lattice.full_brick_box(b)},
               lattice.full_brick_box(b));
    visit_sample(lattice.type, [&](auto tag) {
      using T = typename decltype(tag)::type;
      add_samples<T>(lattice, b, brick.data(), std::max<Index>(step, 1), count, values);
    });
  }
  return values;
}

/// Of level 0, one layer of chunks of ranges at a time.
ValueRange<double> whole_range(const StoreReader& store) {
  const Int3 bricks = store.info().levels.front().lattice.bricks();
  ValueRange<double> range;
  for (Index z = 0; z < bricks.z; z += StoreReader::kRangeChunk) {
    const Index end = std::min(bricks.z, z + StoreReader::kRangeChunk);
    for (const auto& r : store.brick_ranges(0, {{0, 0, z}, {bricks.x, bricks.y, end}}).ranges)
      range.include(r);
  }
  return range;
}

double percentile(std::vector<double>& values, double part) {
  const auto last = static_cast<double>(values.size() - 1);
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(std::lround(part * last));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace

std::optional<DisplayWindow> display_window(const StoreReader& store) {
  std::vector<double> values = some_samples(store);
  if (values.empty()) return std::nullopt;
  const auto [lo, hi] = std::minmax_element(values.begin(), values.end());
  const ValueRange<double> range = whole_range(store);
  DisplayWindow window{*lo, *hi};
  if (std::isfinite(range.lo) && std::isfinite(range.hi)) window = {range.lo, range.hi};
  window.start = percentile(values, 0.005);
  window.end = percentile(values, 0.995);
  // Where nearly all is background, what is not must show.
  if (!(window.start < window.end)) window.start = window.min, window.end = window.max;
  if (!(window.start < window.end)) window.end = window.start + 1;
  return window;
}

}  // namespace isobrick
