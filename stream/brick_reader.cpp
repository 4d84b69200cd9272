#include "stream/brick_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include <isobrick/error.h>
#include "core/surface_range.h"

namespace isobrick::inline v0 {
namespace {

/// Of range tables that are kept: some chunks of them, for bricks come in Morton order.
constexpr std::uint64_t kKept = std::uint64_t{4} << 20;

/// Side by side, so that the compiler makes vectors of them.
template <class T>
struct Lanes {
  static constexpr std::size_t kCount = 128 / sizeof(T);
  T lo[kCount], hi[kCount];
};

template <class T>
[[gnu::always_inline]] inline void include_row(Lanes<T>& lanes, const T* samples,
                                               std::size_t count) {
  constexpr std::size_t n = Lanes<T>::kCount;
  for (; count >= n; samples += n, count -= n)
    for (std::size_t i = 0; i < n; ++i) {
      lanes.lo[i] = samples[i] < lanes.lo[i] ? samples[i] : lanes.lo[i];
      lanes.hi[i] = samples[i] > lanes.hi[i] ? samples[i] : lanes.hi[i];
    }
  for (std::size_t i = 0; i < count; ++i) {
    lanes.lo[i] = samples[i] < lanes.lo[i] ? samples[i] : lanes.lo[i];
    lanes.hi[i] = samples[i] > lanes.hi[i] ? samples[i] : lanes.hi[i];
  }
}

/// The range of the first `extent` samples of a brick.
template <class T>
[[gnu::always_inline]] inline ValueRange<double> range_of(const T* samples, Int3 brick,
                                                          Int3 extent) {
  Lanes<T> lanes;
  std::fill(std::begin(lanes.lo), std::end(lanes.lo), ValueRange<T>::kHighest);
  std::fill(std::begin(lanes.hi), std::end(lanes.hi), ValueRange<T>::kLowest);
  if (extent == brick) {
    include_row(lanes, samples, static_cast<std::size_t>(volume(brick)));
  } else {
    for (Index z = 0; z < extent.z; ++z)
      for (Index y = 0; y < extent.y; ++y)
        include_row(lanes, samples + linear_index({0, y, z}, brick),
                    static_cast<std::size_t>(extent.x));
  }
  ValueRange<T> range;
  for (std::size_t i = 0; i < Lanes<T>::kCount; ++i)
    range.include(ValueRange<T>{lanes.lo[i], lanes.hi[i]});
  return surface_range(range);
}

#ifdef __x86_64__
template <class T>
[[gnu::target("avx2")]] ValueRange<double> range_of_avx2(const T* samples, Int3 brick,
                                                         Int3 extent) {
  return range_of(samples, brick, extent);
}
#endif

template <class T>
ValueRange<double> range_of_fast(const T* samples, Int3 brick, Int3 extent) {
#ifdef __x86_64__
  static const bool avx2 = __builtin_cpu_supports("avx2");
  if (avx2) return range_of_avx2(samples, brick, extent);
#endif
  return range_of(samples, brick, extent);
}

}  // namespace

BrickReader::BrickReader(const StoreReader& store, int level)
    : store_(store),
      level_(level),
      lattice_(store.info().levels.at(static_cast<std::size_t>(level)).lattice),
      tables_(kKept) {}

ValueRange<double> BrickReader::stored_range(Int3 brick) const {
  if (!store_.has_ranges(level_)) {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    return {-infinity, infinity};
  }
  constexpr Index n = StoreReader::kRangeChunk;
  const Int3 chunk{brick.x / n, brick.y / n, brick.z / n};
  const Int3 chunks = ceil_div(lattice_.bricks(), {n, n, n});
  const auto table = tables_.get(static_cast<std::uint64_t>(linear_index(chunk, chunks)), [&] {
    const Box3 box =
        intersect({chunk * n, (chunk + Int3{1, 1, 1}) * n}, {{0, 0, 0}, lattice_.bricks()});
    auto read = std::make_shared<const RangeTable>(store_.brick_ranges(level_, box));
    const std::uint64_t bytes = read->ranges.size() * sizeof read->ranges[0];
    return std::pair(std::move(read), bytes);
  });
  return table->at(brick);
}

bool BrickReader::read(Int3 brick, std::byte* out) const {
  const bool present = store_.read_brick(level_, brick, out);
  check(brick, present ? out : nullptr);
  return present;
}

std::optional<std::size_t> BrickReader::read_packed(Int3 brick, std::span<std::byte> out) const {
  const auto bytes = store_.read_packed(level_, brick, out);
  if (!bytes) check(brick, nullptr);
  return bytes;
}

void BrickReader::will_need(std::span<const Int3> bricks) const {
  store_.will_need(level_, bricks);
}

/// An absent brick has no `samples`.
void BrickReader::check(Int3 brick, const std::byte* samples) const {
  if (!store_.has_ranges(level_)) return;
  const ValueRange<double> stored = stored_range(brick);
  ValueRange<double> found;
  if (samples)
    found = visit_sample(lattice_.type, [&](auto tag) {
      using T = typename decltype(tag)::type;
      const Int3 extent = min(lattice_.brick, lattice_.extent - brick * lattice_.brick);
      return range_of_fast(reinterpret_cast<const T*>(samples), lattice_.brick, extent);
    });
  else
    found.include(store_.info().fill_value);
  if (!found.empty() && (found.lo < stored.lo || found.hi > stored.hi)) fail(brick, stored, found);
}

void BrickReader::fail(Int3 b, const ValueRange<double>& stored,
                       const ValueRange<double>& found) const {
  const auto place = store_.locate(level_, b);
  const std::string where =
      place ? fmt::format("'{}' at {} + {}", store_.storage()->name_of(place->key), place->offset,
                          place->size)
            : fmt::format("'{}': no such brick", store_.info().name);
  throw DamageError(fmt::format(
      "level {}, brick ({}, {}, {}): {}: its samples go from {} to {}, but its stored range is {} "
      "to {}: it belongs to another place or store; see: isobrick verify",
      level_, b.x, b.y, b.z, where, found.lo, found.hi, stored.lo, stored.hi));
}

}  // namespace isobrick
