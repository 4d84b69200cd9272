#include <isobrick/histogram.h>

#include <gtest/gtest.h>

#include <numeric>

#include "tests/pipeline/convert_store.h"

namespace isobrick::test {
namespace {

TEST(Histogram, CountsEverySampleOnceInAsManyBinsAsAllowed) {
  const TemporaryFolder folder;
  const Int3 extent{70, 40, 33};
  MemorySource source = make_source<std::uint16_t>(extent, 3);
  convert_quietly(source, folder / "a.zarr", {.brick = 32, .shard = 64});
  const StoreReader store(folder / "a.zarr");
  NoProgress silent;
  for (const int bins : {1, 64, 199, 300}) {
    const Histogram h = histogram(store, silent, bins);
    EXPECT_LE(h.counts.size(), static_cast<std::size_t>(bins));
    EXPECT_EQ(std::accumulate(h.counts.begin(), h.counts.end(), std::uint64_t{0}),
              static_cast<std::uint64_t>(volume(extent)));
    EXPECT_GT(2 * h.counts.size(), static_cast<std::size_t>(bins));
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

}  // namespace
}  // namespace isobrick::test
