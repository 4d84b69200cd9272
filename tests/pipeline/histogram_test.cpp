#include <isobrick/histogram.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "tests/pipeline/convert_store.h"
#include "tests/pipeline/drop_histogram.h"

namespace isobrick::test {
namespace {

TEST(Histogram, CountsEverySampleOnceInAsManyBinsAsAllowed) {
  const TemporaryFolder folder;
  const Int3 extent{70, 40, 33};
  MemorySource source = make_source<std::uint16_t>(extent, 3);
  convert_quietly(source, folder / "a.zarr", {.brick = 32, .shard = 64});
  convert_quietly(source, folder / "b.zarr", {.brick = 32, .shard = 64});
  drop_histogram(folder / "b.zarr");
  NoProgress silent;
  for (const char* name : {"a.zarr", "b.zarr"}) {
    const StoreReader store(folder / name);
    EXPECT_EQ(stored_histogram(store).has_value(), name[0] == 'a');
    for (const int bins : {1, 64, 199, 300}) {
      const Histogram h = histogram(store, silent, bins);
      EXPECT_LE(h.counts.size(), static_cast<std::size_t>(bins));
      EXPECT_EQ(std::accumulate(h.counts.begin(), h.counts.end(), std::uint64_t{0}),
                static_cast<std::uint64_t>(volume(extent)));
      EXPECT_GT(2 * h.counts.size(), static_cast<std::size_t>(bins));
      EXPECT_EQ(h.first, h.lo);
      // All bins by hand: of whole numbers, with whole numbers.
      const std::vector<std::byte> samples = samples_of(store, h.level);
      std::vector<std::uint64_t> counts(h.counts.size());
      for (std::size_t i = 0; i < samples.size(); i += 2) {
        std::uint16_t v = 0;
        std::memcpy(&v, samples.data() + i, 2);
        ++counts[(v - static_cast<unsigned>(h.lo)) / static_cast<unsigned>(h.bin_width)];
      }
      EXPECT_EQ(h.counts, counts);
    }
  }
}

Histogram make(double first, double width, bool whole, std::vector<std::uint64_t> counts) {
  Histogram h;
  h.first = first;
  h.lo = first;
  h.hi = first + width * static_cast<double>(counts.size() - (whole && width == 1 ? 1 : 0));
  h.bin_width = width;
  h.whole_numbers = whole;
  h.counts = std::move(counts);
  return h;
}

/// The bin that ends the lower class, of all ways to split: each with sums of its own.
std::size_t brute_otsu(const std::vector<std::uint64_t>& counts) {
  long double largest = -1;
  std::size_t best = 0;
  for (std::size_t split = 0; split + 1 < counts.size(); ++split) {
    std::uint64_t weight[2] = {}, sum[2] = {};
    for (std::size_t i = 0; i < counts.size(); ++i) {
      weight[i > split] += counts[i];
      sum[i > split] += counts[i] * i;
    }
    if (weight[0] == 0 || weight[1] == 0) continue;
    const auto w = [&](int c) { return static_cast<long double>(weight[c]); };
    const auto mean = [&](int c) { return static_cast<long double>(sum[c]) / w(c); };
    const long double variance = w(0) * w(1) * (mean(0) - mean(1)) * (mean(0) - mean(1));
    if (variance > largest) largest = variance, best = split;
  }
  return best;
}

TEST(Otsu, IsTheBestOfAllSplits) {
  std::mt19937_64 random(5);
  for (int round = 0; round < 40; ++round) {
    std::vector<std::uint64_t> counts(2 + random() % 300);
    for (auto& n : counts) n = random() % 4 == 0 ? 0 : random() % 1000;
    for (std::size_t i = 0; i < 5; ++i) counts[random() % counts.size()] += random() % 50'000;
    counts.front() = counts.back() = 1;
    const auto best = static_cast<double>(brute_otsu(counts));
    EXPECT_EQ(otsu(make(-40, 1, true, counts)), best - 40) << round;
    EXPECT_EQ(otsu(make(-40, 4, true, counts)), 4 * best - 40 + 1.5) << round;
    EXPECT_EQ(otsu(make(3, 0.25, false, counts)), 3 + 0.25 * (best + 0.5)) << round;
  }
}

TEST(Otsu, OfFewBins) {
  EXPECT_EQ(otsu(make(0, 1, true, {})), std::nullopt);
  EXPECT_EQ(otsu(make(0, 1, true, {5})), std::nullopt);
  EXPECT_EQ(otsu(make(0, 1, true, {0, 5, 0})), std::nullopt);
  EXPECT_EQ(otsu(make(7, 1, true, {5, 3})), 7);
  // Of empty bins between two classes, the first.
  EXPECT_EQ(otsu(make(7, 1, true, {5, 0, 0, 0, 3})), 7);
  // The bins of all doubles reach beyond the largest of them.
  std::vector<std::uint64_t> counts(65536);
  counts.front() = counts.back() = 9;
  counts[40000] = 1;
  EXPECT_EQ(otsu(make(-std::ldexp(1.0, 1023), std::ldexp(1.0, 1008), false, counts)),
            std::ldexp(0.5 - 32768, 1008));
}

TEST(Percentile, OfIntegersIsASample) {
  std::mt19937_64 random(2);
  for (const std::size_t samples : {1u, 2u, 7u, 100u, 1000u}) {
    std::vector<std::uint64_t> counts(50);
    std::vector<int> values;
    for (std::size_t i = 0; i < samples; ++i) {
      values.push_back(static_cast<int>(random() % 50));
      ++counts[static_cast<std::size_t>(values.back())];
    }
    std::sort(values.begin(), values.end());
    for (const double percent : {0.0, 0.1, 25.0, 50.0, 75.0, 90.0, 99.5, 100.0}) {
      // The first sample below or at which lies so large a part of all.
      std::size_t rank = 0;
      while (static_cast<double>(rank + 1) < static_cast<double>(samples) * (percent / 100)) ++rank;
      EXPECT_EQ(percentile(make(-20, 1, true, counts), percent), values[rank] - 20)
          << percent << " of " << samples;
    }
  }
}

TEST(Percentile, OfFractionsLiesWithinABin) {
  const Histogram h = make(10, 0.5, false, {4, 0, 12});
  EXPECT_EQ(percentile(h, 0), 10);
  EXPECT_EQ(percentile(h, 12.5), 10.25);
  EXPECT_EQ(percentile(h, 25), 10.5);
  EXPECT_EQ(percentile(h, 62.5), 11.25);
  EXPECT_EQ(percentile(h, 100), 11.5);
  EXPECT_EQ(percentile(h, -1), std::nullopt);
  EXPECT_EQ(percentile(h, 100.5), std::nullopt);
  EXPECT_EQ(percentile(h, std::nan("")), std::nullopt);
  EXPECT_EQ(percentile(make(0, 1, false, {}), 50), std::nullopt);
  // Never beyond the samples, though the bins are.
  Histogram narrow = make(10, 0.5, false, {8});
  narrow.lo = 10.125;
  narrow.hi = 10.25;
  EXPECT_EQ(percentile(narrow, 0), 10.125);
  EXPECT_EQ(percentile(narrow, 100), 10.25);
}

TEST(Rebin, KeepsEverySample) {
  std::vector<std::uint64_t> counts(65536, 2);
  Histogram all = make(-std::ldexp(1.0, 1023), std::ldexp(1.0, 1008), false, counts);
  all.hi = std::numeric_limits<double>::max() / 2;
  for (const int bins : {1, 2, 64, 1000}) {
    const Histogram h = rebin(all, bins);
    EXPECT_EQ(h.counts.size(), static_cast<std::size_t>(bins));
    EXPECT_EQ(std::accumulate(h.counts.begin(), h.counts.end(), std::uint64_t{0}), 131072u);
    const auto [least, most] = std::minmax_element(h.counts.begin(), h.counts.end());
    EXPECT_LE(*most - *least, 4u) << bins;
  }
  EXPECT_EQ(rebin(make(3, 1, true, {1, 2, 3, 4, 5}), 2).counts, (std::vector<std::uint64_t>{6, 9}));
  EXPECT_TRUE(rebin(make(3, 1, true, {}), 2).counts.empty());
}

TEST(Histogram, AValueFarFromAllOthers) {
  std::vector<std::uint64_t> counts(40000);
  counts.front() = 7;
  counts.back() = 1000;
  counts[counts.size() - 100] = 5;
  const Histogram low = make(-1e4, 0.25, false, counts);
  EXPECT_EQ(far_value(low), -1e4);
  EXPECT_EQ(far_value(make(-1e4, 2, true, counts)), -1e4);
  EXPECT_EQ(far_value(make(0, 1, true, counts)), std::nullopt) << "each value has a bin";
  std::reverse(counts.begin(), counts.end());
  EXPECT_EQ(far_value(make(0, 0.25, false, counts)), 1e4);
  counts[20000] = 1;
  EXPECT_EQ(far_value(make(0, 0.25, false, counts)), std::nullopt);
  EXPECT_EQ(far_value(make(0, 0.25, false, {1, 0, 0, 9})), std::nullopt);
  EXPECT_EQ(far_value(Histogram()), std::nullopt);
}

}  // namespace
}  // namespace isobrick::test
