#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <isobrick/range.h>
#include <isobrick/vec.h>

namespace isobrick::inline v0 {

template <class T>
struct RangeSet {
  std::string name;
  std::vector<ValueRange<T>> ranges;
  Int3 grid;
};

/// Equal on every machine, unlike the distributions of the standard library.
class Dice {
 public:
  explicit Dice(std::uint32_t seed) : engine_(seed) {}
  std::uint64_t below(std::uint64_t n) { return engine_() % n; }
  double unit() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }

 private:
  std::mt19937_64 engine_;
};

/// The value at a fraction 0 … 1 of what tests use of T: all of the integers, −1000 … 1000 of the
/// others.
template <class T>
T value_at(double fraction) {
  if constexpr (std::is_floating_point_v<T>) return static_cast<T>(2000 * fraction - 1000);
  using Limits = std::numeric_limits<T>;
  const auto lo = static_cast<double>(Limits::lowest()), hi = static_cast<double>(Limits::max());
  return static_cast<T>(std::floor(lo + fraction * (hi - lo)));
}

template <class T>
ValueRange<T> range_at(double lo, double hi) {
  return {value_at<T>(std::min(lo, hi)), value_at<T>(std::max(lo, hi))};
}

/// n ranges whose kth is make(k), as a list.
template <class T, class Make>
RangeSet<T> list_of(std::string name, std::size_t n, Make make) {
  RangeSet<T> set{std::move(name), {}, {static_cast<Index>(n), 1, 1}};
  for (std::size_t k = 0; k < n; ++k)
    set.ranges.push_back(make(static_cast<double>(k) / static_cast<double>(n)));
  return set;
}

/// Sets that are hard on one structure or another; about n ranges each.
template <class T>
std::vector<RangeSet<T>> range_sets(std::size_t n) {
  Dice dice(20240607);
  const auto any = [&] { return range_at<T>(dice.unit(), dice.unit()); };
  const auto narrow = [&](double at, double width) {
    return range_at<T>(at, std::min(1.0, at + width * dice.unit()));
  };
  std::vector<RangeSet<T>> sets;
  sets.push_back({"nothing", {}, {0, 0, 0}});
  sets.push_back({"one", {range_at<T>(0.25, 0.75)}, {1, 1, 1}});
  sets.push_back({"one constant", {range_at<T>(0.5, 0.5)}, {1, 1, 1}});
  sets.push_back({"one empty", {ValueRange<T>{}}, {1, 1, 1}});
  sets.push_back(list_of<T>("two", 2, [&](double) { return any(); }));
  sets.push_back(list_of<T>("random", n, [&](double) { return any(); }));
  sets.push_back(list_of<T>("narrow", n, [&](double) { return narrow(dice.unit(), 0.01); }));
  sets.push_back(list_of<T>(
      "disjoint", n, [&](double f) { return range_at<T>(f, f + 1.0 / static_cast<double>(n)); }));
  sets.push_back(list_of<T>("nested", n, [](double f) { return range_at<T>(f / 2, 1 - f / 2); }));
  sets.push_back(list_of<T>("all equal", n, [](double) { return range_at<T>(0.3, 0.6); }));
  sets.push_back(list_of<T>("all constant", n, [](double f) { return range_at<T>(f, f); }));
  sets.push_back(list_of<T>("one min", n, [&](double) { return range_at<T>(0, dice.unit()); }));
  sets.push_back(list_of<T>("one max", n, [&](double) { return range_at<T>(1, dice.unit()); }));
  sets.push_back(
      list_of<T>("descending", n, [](double f) { return range_at<T>(0.8 - f / 2, 1 - f / 2); }));
  sets.push_back(list_of<T>("skewed", n, [&](double) {
    const double at = std::pow(dice.unit(), 12);
    return narrow(at, at);
  }));
  sets.push_back(
      list_of<T>("powers", n, [](double f) { return range_at<T>(0, std::exp2(-60 * f)); }));
  sets.push_back(list_of<T>("mostly empty", n,
                            [&](double) { return dice.below(10) ? ValueRange<T>{} : any(); }));
  sets.push_back(list_of<T>("ends of the type", n, [&](double) {
    using Range = ValueRange<T>;
    const ValueRange<T> choice[] = {{Range::kLowest, Range::kHighest},
                                    any(),
                                    {},
                                    {Range::kLowest, Range::kLowest},
                                    {any().lo, Range::kHighest},
                                    {Range::kLowest, any().hi}};
    return choice[dice.below(std::size(choice))];
  }));
  if constexpr (std::is_floating_point_v<T>) {
    using Limits = std::numeric_limits<T>;
    sets.push_back(list_of<T>("not numbers", n, [&](double) {
      const T nan = Limits::quiet_NaN();
      const ValueRange<T> choice[] = {{nan, any().hi}, {any().lo, nan}, {nan, nan}, any()};
      return choice[dice.below(std::size(choice))];
    }));
    sets.push_back(list_of<T>("zeros and tiny", n, [&](double) {
      const T tiny = Limits::denorm_min();
      const T value[] = {T(0), -T(0), tiny, -tiny, Limits::min(), -Limits::min(), T(1), T(-1)};
      ValueRange<T> range;
      range.include(value[dice.below(8)]);
      range.include(value[dice.below(8)]);
      return range;
    }));
    sets.push_back(list_of<T>("huge", n, [&](double) {
      ValueRange<T> range;
      for (int i = 0; i < 2; ++i)
        range.include(static_cast<T>((dice.unit() * 2 - 1) * static_cast<double>(Limits::max())));
      return range;
    }));
  }
  for (const Int3 grid :
       {Int3{1, 1, 37}, Int3{5, 1, 9}, Int3{7, 6, 5}, Int3{17, 3, 2}, Int3{16, 16, 2}})
    sets.push_back(
        {"grid",
         list_of<T>("", static_cast<std::size_t>(volume(grid)),
                    [&](double f) { return dice.below(4) ? narrow(f, 0.2) : ValueRange<T>{}; })
             .ranges,
         grid});
  return sets;
}

/// Isovalues at, just beside and between the bounds of up to `most` of the
/// ranges, and those that are always special.
template <class T>
std::vector<double> isovalues_for(const std::vector<ValueRange<T>>& ranges, std::size_t most) {
  constexpr double inf = std::numeric_limits<double>::infinity();
  std::vector<double> isovalues{-inf, inf, std::nan(""), 0, -0.0, 0.5, 1e300, -1e300, 4294967296.0};
  const std::size_t step = ranges.size() / most + 1;
  for (std::size_t i = 0; i < ranges.size(); i += step)
    for (const double v : {static_cast<double>(ranges[i].lo), static_cast<double>(ranges[i].hi)})
      for (const double iso :
           {v, std::nextafter(v, inf), std::nextafter(v, -inf), v + 0.5, v - 0.5})
        isovalues.push_back(iso);
  return isovalues;
}

/// What every structure must answer, from the definition.
template <class T>
std::vector<std::uint32_t> stabbed(const std::vector<ValueRange<T>>& ranges, double iso) {
  std::vector<std::uint32_t> ids;
  for (std::size_t i = 0; i < ranges.size(); ++i)
    if (ranges[i].stabbed_by(iso)) ids.push_back(static_cast<std::uint32_t>(i));
  return ids;
}

}  // namespace isobrick
