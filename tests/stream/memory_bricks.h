#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include <isobrick/error.h>
#include "pipeline/convert/downsample.h"
#include "stream/brick_source.h"

namespace isobrick::test {

/// A pyramid in memory, made as a conversion makes it. Can be slow and damaged.
class MemoryBricks final : public BrickSource {
 public:
  struct Options {
    Index brick = 32;
    int levels = 0;  ///< 0: until one brick holds the coarsest
    /// Of each step in turn, the last one of all further steps; none: all axes are halved.
    std::vector<Int3> factors;
    Transform transform;
    double fill_value = 0;  ///< bricks of it are absent
  };

  template <class T>
  MemoryBricks(Int3 extent, const std::function<T(Int3)>& f, const Options& options) {
    info_.type = scalar_type_of<T>;
    info_.name = "memory";
    info_.fill_value = options.fill_value;
    info_.may_have_nan = std::is_floating_point_v<T>;
    std::vector<std::byte> samples(static_cast<std::size_t>(volume(extent)) * sizeof(T));
    std::size_t i = 0;
    for_each_point({{0, 0, 0}, extent}, [&](Int3 p) {
      const T v = f(p);
      std::memcpy(samples.data() + sizeof(T) * i++, &v, sizeof v);
    });
    LevelInfo level;
    level.lattice = {extent, {options.brick, options.brick, options.brick}, info_.type};
    level.transform = options.transform;
    for (;;) {
      level.shard = level.lattice.brick;
      info_.levels.push_back(level);
      samples_.push_back(samples);
      const Int3 e = level.lattice.extent, bricks = level.lattice.bricks();
      const auto count = static_cast<int>(info_.levels.size());
      if (options.levels ? count == options.levels : volume(bricks) == 1) break;
      const auto step = static_cast<std::size_t>(count) - 1;
      const Int3 factors = options.factors.empty()
                               ? kHalveAll
                               : options.factors[std::min(step, options.factors.size() - 1)];
      const Int3 coarser = coarser_extent(e, factors);
      std::vector<std::byte> next(static_cast<std::size_t>(volume(coarser)) * sizeof(T));
      downsample(Downsampling::mean, info_.type, e, factors, samples.data(), next.data());
      samples = std::move(next);
      level.transform = coarser_transform(level.transform, e, factors);
      level.lattice.extent = coarser;
    }
  }

  const StoreInfo& info() const override { return info_; }

  bool read_brick(int level, Int3 b, std::byte* out) const override {
    ++reads_;
    if (const auto delay = delay_.load(); delay.count() > 0) std::this_thread::sleep_for(delay);
    if (damaged_.contains({level, b.x, b.y, b.z})) throw DamageError("a brick is damaged");
    const Lattice& l = lattice(level);
    const Box3 box = l.brick_box(b);
    const std::size_t size = l.sample_bytes();
    std::memset(out, 0, l.brick_bytes());
    bool all_fill = true;
    for (Index z = box.lo.z; z < box.hi.z; ++z)
      for (Index y = box.lo.y; y < box.hi.y; ++y)
        for (Index x = box.lo.x; x < box.hi.x; ++x) {
          const Int3 p{x, y, z};
          all_fill &= value(level, p) == info_.fill_value;
          std::memcpy(out + static_cast<std::size_t>(linear_index(p - box.lo, l.brick)) * size,
                      at(level, p), size);
        }
    return !all_fill;
  }

  void will_need(int level, Int3 b) const override {
    const std::lock_guard lock(mutex_);
    hinted_.insert({level, b.x, b.y, b.z});
  }

  RangeTable brick_ranges(int level, Box3 box) const override {
    return ranges(level, box, lattice(level).brick);
  }
  RangeTable block_ranges(int level, Box3 box) const override {
    return ranges(level, box, {kBlockEdge, kBlockEdge, kBlockEdge});
  }

  double value(int level, Int3 p) const {
    return visit_scalar(info_.type, [&](auto tag) {
      typename decltype(tag)::type v;
      std::memcpy(&v, at(level, p), sizeof v);
      return static_cast<double>(v);
    });
  }

  void set_delay(std::chrono::milliseconds delay) { delay_ = delay; }
  void damage(int level, Int3 b) { damaged_.insert({level, b.x, b.y, b.z}); }
  std::uint64_t reads() const { return reads_; }
  using BrickNumber = std::tuple<int, Index, Index, Index>;  ///< level, x, y, z
  /// The bricks that somebody hinted at since the last call.
  std::set<BrickNumber> take_hints() {
    const std::lock_guard lock(mutex_);
    return std::exchange(hinted_, {});
  }
  std::uint64_t bytes() const {
    std::uint64_t bytes = 0;
    for (const auto& level : samples_) bytes += level.size();
    return bytes;
  }
  StoreInfo& mutable_info() { return info_; }

 private:
  const Lattice& lattice(int level) const {
    return info_.levels[static_cast<std::size_t>(level)].lattice;
  }
  const std::byte* at(int level, Int3 p) const {
    const Lattice& l = lattice(level);
    return samples_[static_cast<std::size_t>(level)].data() +
           static_cast<std::size_t>(linear_index(p, l.extent)) * l.sample_bytes();
  }
  RangeTable ranges(int level, Box3 box, Int3 edge) const {
    RangeTable table{box, {}};
    for_each_point(box, [&](Int3 item) {
      ValueRange<double> range;
      for_each_point(intersect({item * edge, (item + Int3{1, 1, 1}) * edge + Int3{1, 1, 1}},
                               lattice(level).box()),
                     [&](Int3 p) { range.include(value(level, p)); });
      table.ranges.push_back(range);
    });
    return table;
  }

  StoreInfo info_;
  std::vector<std::vector<std::byte>> samples_;
  std::set<BrickNumber> damaged_;
  mutable std::mutex mutex_;
  mutable std::set<BrickNumber> hinted_;
  std::atomic<std::chrono::milliseconds> delay_{std::chrono::milliseconds{0}};
  mutable std::atomic<std::uint64_t> reads_ = 0;
};

/// Fields with a closed surface at 0, larger values inside, over a cube of `n` samples.
inline double ball(Int3 p, Index n) {
  const double c = static_cast<double>(n - 1) / 2, r = 0.4 * static_cast<double>(n);
  const double x = static_cast<double>(p.x) - c, y = static_cast<double>(p.y) - c,
               z = static_cast<double>(p.z) - c;
  return r - std::sqrt(x * x + y * y + z * z);
}

inline double gyroid_ball(Int3 p, Index n) {
  const double k = 2 * 3.14159265358979 * 3 / static_cast<double>(n);
  const double x = k * static_cast<double>(p.x), y = k * static_cast<double>(p.y),
               z = k * static_cast<double>(p.z);
  const double g =
      std::sin(x) * std::cos(y) + std::sin(y) * std::cos(z) + std::sin(z) * std::cos(x);
  return std::min(g / k, ball(p, n));
}

/// Smooth noise cut by the ball: lobes and tunnels of all directions.
inline double blobs(Int3 p, Index n) {
  const auto lattice_value = [](Index x, Index y, Index z) {
    auto h = static_cast<std::uint64_t>(x * 73856093 ^ y * 19349663 ^ z * 83492791);
    h = (h ^ h >> 31) * 0x9e3779b97f4a7c15ULL;
    return static_cast<double>(h >> 40) / static_cast<double>(1 << 23) - 1;
  };
  constexpr Index cell = 13;
  const Int3 i{p.x / cell, p.y / cell, p.z / cell};
  double f[3];
  for (int axis = 0; axis < 3; ++axis) {
    const double t = static_cast<double>(p[axis] % cell) / cell;
    f[axis] = t * t * (3 - 2 * t);
  }
  double sum = 0;
  for (int c = 0; c < 8; ++c) {
    const double w =
        (c & 1 ? f[0] : 1 - f[0]) * (c & 2 ? f[1] : 1 - f[1]) * (c & 4 ? f[2] : 1 - f[2]);
    sum += w * lattice_value(i.x + (c & 1), i.y + (c >> 1 & 1), i.z + (c >> 2));
  }
  return std::min(sum * 8, ball(p, n));
}

}  // namespace isobrick::test
