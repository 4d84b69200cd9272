#include "pipeline/index/value_counts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <thread>

#include "tests/pipeline/naive_counts.h"

namespace isobrick::test {
namespace {

template <class T>
using Limits = std::numeric_limits<T>;

/// Adds the samples as a volume of rows of `width`, in boxes of `box` samples, on so many threads.
template <class T>
SampleCounts count(const std::vector<T>& samples, Index width = 0, Int3 box = {1 << 30, 8, 8},
                   int threads = 1) {
  const auto all = static_cast<Index>(samples.size());
  if (width == 0) width = all;
  const Int3 extent{width, 4, all / width / 4};
  const Box3 whole{{0, 0, 0}, volume(extent) == all ? extent : Int3{all, 1, 1}};
  const auto counts = make_value_counts(scalar_type_of<T>);
  std::vector<Box3> parts;
  for_each_point({{0, 0, 0}, ceil_div(whole.hi, box)}, [&](Int3 p) {
    parts.push_back(intersect({p * box, (p + Int3{1, 1, 1}) * box}, whole));
  });
  std::vector<std::thread> workers;
  for (int t = 0; t < threads; ++t)
    workers.emplace_back([&, t] {
      for (std::size_t i = static_cast<std::size_t>(t); i < parts.size();
           i += static_cast<std::size_t>(threads))
        counts->add(reinterpret_cast<const std::byte*>(samples.data()), whole, parts[i]);
    });
  for (std::thread& worker : workers) worker.join();
  return counts->counts();
}

template <class T>
class ValueCountsOf : public ::testing::Test {
 protected:
  /// Samples of several kinds, a multiple of 256 of each.
  static std::vector<std::vector<T>> sets() {
    std::mt19937_64 random(7);
    const auto make = [&](auto&& f) {
      std::vector<T> samples(32 * 256);
      for (std::size_t i = 0; i < samples.size(); ++i) samples[i] = static_cast<T>(f(i));
      return samples;
    };
    std::vector<std::vector<T>> sets{
        make([](std::size_t i) { return i % 100; }), make([](std::size_t) { return 3; }),
        make([](std::size_t) { return 0; }),
        make([](std::size_t i) { return i < 5000 ? 0 : i % 7; }), make([&](std::size_t i) {
          return i % 1000 == 999 ? Limits<T>::lowest() : Limits<T>::max();
        })};
    std::vector<T> wide(32 * 256), spread(32 * 256);
    for (T& v : wide) {
      if constexpr (std::is_floating_point_v<T>)
        v = static_cast<T>(std::ldexp(std::uniform_real_distribution<double>(-1, 1)(random),
                                      static_cast<int>(random() % (sizeof(T) == 4 ? 250 : 1900)) -
                                          (sizeof(T) == 4 ? 140 : 1000)));
      else
        v = static_cast<T>(random());
    }
    for (T& v : spread) v = static_cast<T>(std::normal_distribution<double>(60, 9)(random));
    sets.push_back(wide);
    sets.push_back(spread);
    if constexpr (std::is_floating_point_v<T>) {
      // What the sign and the exponent make special.
      const T odd[] = {T{0},
                       -T{0},
                       Limits<T>::denorm_min(),
                       -Limits<T>::denorm_min(),
                       Limits<T>::min(),
                       -Limits<T>::min(),
                       Limits<T>::quiet_NaN(),
                       -Limits<T>::quiet_NaN(),
                       Limits<T>::infinity(),
                       -Limits<T>::infinity(),
                       T{1},
                       -T{1},
                       T(0.1),
                       T(1e30),
                       T(-1e30),
                       T(65536.5)};
      for (const std::size_t some : {2u, 4u, 6u, 8u, 12u, 16u})
        sets.push_back(make([&](std::size_t) { return odd[random() % some]; }));
      sets.push_back(make([](std::size_t) { return Limits<T>::quiet_NaN(); }));
      sets.push_back(
          make([](std::size_t i) { return i % 2 ? Limits<T>::infinity() : Limits<T>::max(); }));
      sets.push_back(
          make([&](std::size_t i) { return 1 + static_cast<T>(i % 77) * Limits<T>::epsilon(); }));
      sets.push_back(
          make([](std::size_t i) { return -Limits<T>::denorm_min() * static_cast<T>(i); }));
    }
    return sets;
  }
};

using SampleTypes = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                     std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(ValueCountsOf, SampleTypes);

TYPED_TEST(ValueCountsOf, AreThoseOfTheDefinitionInEveryOrder) {
  std::mt19937 random(1);
  int set = 0;
  for (std::vector<TypeParam> samples : this->sets()) {
    SCOPED_TRACE(set++);
    const SampleCounts expected = naive_counts<TypeParam>(samples);
    EXPECT_EQ(count(samples), expected);
    for (int i = 0; i < 3; ++i) {
      std::shuffle(samples.begin(), samples.end(), random);
      EXPECT_EQ(count(samples), expected);
    }
    // The bins grow with every sample.
    std::sort(samples.begin(), samples.end(), [](TypeParam a, TypeParam b) {
      return std::abs(static_cast<double>(a)) < std::abs(static_cast<double>(b));
    });
    EXPECT_EQ(count(samples, 1, {1, 1, 1}), expected);
    std::reverse(samples.begin(), samples.end());
    EXPECT_EQ(count(samples), expected);
  }
}

TYPED_TEST(ValueCountsOf, DoNotDependOnPiecesOrThreads) {
  int set = 0;
  for (const std::vector<TypeParam>& samples : this->sets()) {
    SCOPED_TRACE(set++);
    const SampleCounts expected = naive_counts<TypeParam>(samples);
    for (const Index width : {1, 64})
      for (const Int3 box : {Int3{7, 3, 5}, Int3{64, 1, 64}, Int3{256, 4, 16}})
        for (const int threads : {1, 4})
          EXPECT_EQ(count(samples, width, box, threads), expected)
              << width << " " << box.x << " " << threads;
  }
}

TYPED_TEST(ValueCountsOf, AValueManyTimes) {
  const auto counts = make_value_counts(scalar_type_of<TypeParam>);
  const std::uint64_t many = std::uint64_t{5} << 32;
  counts->add(7, many);
  counts->add(100, 1);
  const std::vector<TypeParam> samples(1000, TypeParam{7});
  counts->add(reinterpret_cast<const std::byte*>(samples.data()), {{0, 0, 0}, {10, 10, 10}},
              {{0, 0, 0}, {10, 10, 10}});
  const SampleCounts all = counts->counts();
  EXPECT_EQ(all.counts.front(), many + 1000);
  EXPECT_EQ(all.counts.back(), 1u);
  EXPECT_EQ(all.bins.lo, 7);
  EXPECT_EQ(all.bins.hi, 100);
}

TEST(ValueCounts, NoFiniteValue) {
  const auto counts = make_value_counts(ScalarType::f32);
  EXPECT_EQ(counts->counts(), SampleCounts{});
  counts->add(std::numeric_limits<double>::quiet_NaN(), 3);
  counts->add(-std::numeric_limits<double>::infinity(), 4);
  EXPECT_EQ(counts->counts().bins.not_a_number, 3u);
  EXPECT_EQ(counts->counts().bins.infinite, 4u);
  EXPECT_TRUE(counts->counts().counts.empty());
}

}  // namespace
}  // namespace isobrick::test
