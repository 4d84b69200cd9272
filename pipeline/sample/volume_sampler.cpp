#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <unordered_map>
#include <utility>

#include <isobrick/attributes.h>
#include <isobrick/error.h>
#include "core/length_unit.h"
#include "core/vectors.h"
#include "pipeline/sample/brick_lru.h"
#include "pipeline/slab_reader.h"
#include "pipeline/workers.h"

namespace isobrick::inline v0 {
namespace {

/// Positions that are looked at together.
constexpr std::size_t kBatch = std::size_t{1} << 14;
/// How far, in samples, a point may be outside for its rounding.
constexpr double kBorder = 1e-3;
/// Corners of a cell.
constexpr std::size_t kCorners = 8;

/// Where a point lies in its cell.
struct Place {
  Int3 lo;                  ///< the cell's first sample
  Vec3d t;                  ///< from there, in samples; 0 where there is nothing behind
  bool inside = false;      ///< of the volume
  bool is_whole = false;    ///< whether all samples with a weight are in one brick
  std::uint64_t brick = 0;  ///< that of the first sample
};

Place place_of(Vec3d index, Int3 extent) {
  Place place;
  for (int axis = 0; axis < 3; ++axis) {
    const auto last = static_cast<double>(extent[axis] - 1);
    const double margin = extent[axis] == 1 ? 0.5 + kBorder : kBorder;
    // Written so that a coordinate that is NaN is outside.
    if (!(index[axis] >= -margin && index[axis] <= last + margin)) return {};
    const double at = std::clamp(index[axis], 0.0, last);
    const double floor = std::floor(at);
    place.lo[axis] = static_cast<Index>(floor);
    place.t[axis] = at - floor;
  }
  place.inside = true;
  return place;
}

/// The sample at a corner: bit `axis` of `corner` is set where it is the second along that axis.
Int3 corner_of(const Place& place, std::size_t corner) {
  const auto second = [corner](int axis) { return static_cast<Index>(corner >> axis & 1); };
  return place.lo + Int3{second(0), second(1), second(2)};
}

/// 0 for corners that the value does not depend on.
double weight_of(const Place& place, std::size_t corner) {
  double weight = 1;
  for (int axis = 0; axis < 3; ++axis)
    weight *= (corner >> axis & 1) != 0 ? place.t[axis] : 1 - place.t[axis];
  return weight;
}

}  // namespace

struct VolumeSampler::Impl {
  Impl(const StoreReader& reader, const SampleOptions& options)
      : store(reader),
        level(store.info().levels.front()),
        ratio(unit_ratio(options.unit,
                         level.transform.unit.empty() ? options.volume_unit : level.transform.unit)
                  .value_or(1)),
        workers(options.threads),
        bricks(reader, std::max(kCorners, static_cast<std::size_t>(options.memory /
                                                                   level.lattice.brick_bytes()))) {}

  std::uint64_t brick_number(Int3 sample) const {
    return static_cast<std::uint64_t>(
        linear_index(level.lattice.brick_of(sample), level.lattice.bricks()));
  }
  void find_places(std::span<const Vec3f> positions);
  Place place_in_bricks(Vec3f position) const;
  void need(std::uint64_t brick);
  std::size_t gather_bricks(std::size_t first);
  double sample_at(std::uint64_t brick, Int3 sample) const;
  float value_at(const Place& place) const;

  const StoreReader& store;
  const LevelInfo& level;
  const double ratio;  ///< units of the volume in one of the positions
  Workers workers;
  BrickLru bricks;
  std::vector<Place> places;
  std::vector<std::uint64_t> needed;                     ///< bricks of a run of places
  std::vector<const std::byte*> found;                   ///< their samples
  std::unordered_map<std::uint64_t, std::size_t> order;  ///< of a brick among those needed
};

Place VolumeSampler::Impl::place_in_bricks(Vec3f position) const {
  Place place =
      place_of(level.transform.index_of(to_double(position) * ratio), level.lattice.extent);
  if (!place.inside) return place;
  const auto has_second = [&](int axis) { return static_cast<Index>(place.t[axis] > 0); };
  const Int3 last = place.lo + Int3{has_second(0), has_second(1), has_second(2)};
  place.brick = brick_number(place.lo);
  place.is_whole = brick_number(last) == place.brick;
  return place;
}

void VolumeSampler::Impl::find_places(std::span<const Vec3f> positions) {
  places.resize(positions.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, positions.size(), 1024),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      for (std::size_t i = range.begin(); i < range.end(); ++i)
                        places[i] = place_in_bricks(positions[i]);
                    });
}

void VolumeSampler::Impl::need(std::uint64_t brick) {
  if (order.emplace(brick, needed.size()).second) needed.push_back(brick);
}

/// Collects the bricks of the places from `first` on, as many as fit the cache. Returns the place
/// that the next run begins with.
std::size_t VolumeSampler::Impl::gather_bricks(std::size_t first) {
  needed.clear();
  order.clear();
  std::uint64_t latest = ~std::uint64_t{0};
  std::size_t i = first;
  for (; i < places.size(); ++i) {
    const Place& place = places[i];
    if (!place.inside || (place.is_whole && place.brick == latest)) continue;
    const std::size_t before = needed.size();
    latest = place.brick;
    need(place.brick);
    for (std::size_t corner = 1; corner < kCorners && !place.is_whole; ++corner)
      if (weight_of(place, corner) != 0) need(brick_number(corner_of(place, corner)));
    if (needed.size() <= bricks.capacity()) continue;
    for (std::size_t added = before; added < needed.size(); ++added) order.erase(needed[added]);
    needed.resize(before);
    break;
  }
  return i;
}

double VolumeSampler::Impl::sample_at(std::uint64_t brick, Int3 sample) const {
  const Lattice& lattice = level.lattice;
  const std::byte* samples = found[order.find(brick)->second];
  if (!samples) return store.info().fill_value;
  const Int3 within = sample - lattice.brick_of(sample) * lattice.brick;
  const auto offset = static_cast<std::size_t>(linear_index(within, lattice.brick));
  return visit_scalar(lattice.type, [&](auto tag) {
    typename decltype(tag)::type value;
    std::memcpy(&value, samples + offset * sizeof(value), sizeof(value));
    return static_cast<double>(value);
  });
}

float VolumeSampler::Impl::value_at(const Place& place) const {
  if (!place.inside) return std::numeric_limits<float>::quiet_NaN();
  double sum = 0;
  for (std::size_t corner = 0; corner < kCorners; ++corner)
    if (const double weight = weight_of(place, corner); weight != 0) {
      const Int3 sample = corner_of(place, corner);
      sum += weight * sample_at(place.is_whole ? place.brick : brick_number(sample), sample);
    }
  // All NaN are one, so that the bytes of files do not depend on the processor.
  return std::isnan(sum) ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(sum);
}

VolumeSampler::VolumeSampler(const StoreReader& store, const SampleOptions& options)
    : impl_(std::make_unique<Impl>(store, options)) {}
VolumeSampler::~VolumeSampler() = default;
VolumeSampler::VolumeSampler(VolumeSampler&&) noexcept = default;

void VolumeSampler::sample(std::span<const Vec3f> positions, std::span<float> values) {
  if (positions.size() != values.size())
    throw UsageError("a sampler needs as many values to write as there are positions");
  Impl& impl = *impl_;
  impl.workers.execute([&] {
    for (std::size_t begin = 0; begin < positions.size(); begin += kBatch) {
      const std::size_t count = std::min(kBatch, positions.size() - begin);
      impl.find_places(positions.subspan(begin, count));
      for (std::size_t first = 0; first < count;) {
        const std::size_t end = impl.gather_bricks(first);
        impl.bricks.hold(impl.needed, impl.found);
        tbb::parallel_for(tbb::blocked_range<std::size_t>(first, end, 1024),
                          [&](const tbb::blocked_range<std::size_t>& range) {
                            for (std::size_t i = range.begin(); i < range.end(); ++i)
                              values[begin + i] = impl.value_at(impl.places[i]);
                          });
        first = end;
      }
    }
  });
}

std::uint64_t VolumeSampler::memory() const {
  return impl_->bricks.capacity() * impl_->level.lattice.brick_bytes() +
         slab_memory(impl_->store.info(), 0, impl_->workers.threads()) + kBatch * sizeof(Place);
}

std::uint64_t VolumeSampler::bricks_read() const { return impl_->bricks.reads(); }

}  // namespace isobrick
