#include "bricks/ranges/stored_histogram.h"

#include <gtest/gtest.h>

#include <isobrick/error.h>
#include <isobrick/histogram.h>
#include <isobrick/verify.h>
#include "bricks/ranges/stored_ranges.h"
#include "pipeline/histogram/histogram.h"
#include "tests/pipeline/convert_store.h"
#include "tests/pipeline/drop_histogram.h"
#include "tests/pipeline/naive_counts.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class StoredCounts : public ::testing::Test {
 protected:
  StoredCounts() { convert(2, "a"); }

  void convert(unsigned seed, const char* name) {
    MemorySource source = make_source<std::int16_t>({70, 41, 52}, seed);
    convert_quietly(source, folder_ / name, {.brick = 16, .shard = 32});
  }
  StoreReader store(const char* name = "a") const { return StoreReader(folder_ / name); }
  fs::path chunk(const char* name = "a") const {
    return folder_ / name / histogram_folder("") / "c" / "0";
  }
  /// What verify and readers report of the same damage.
  void expect_damaged(const std::string& part) {
    NoProgress silent;
    const VerifyReport report = verify(folder_ / "a", {.threads = 2}, silent);
    ASSERT_EQ(report.damage_count, 1u) << part;
    EXPECT_NE(report.damages[0].find(part), std::string::npos) << report.damages[0];
    EXPECT_THROW(stored_histogram(store()), DamageError) << part;
    EXPECT_THROW(histogram(store(), silent), DamageError) << part;
  }
  void change_ranges(const std::function<void(StoredHistogram&)>& change) {
    StoredRanges ranges = *read_stored_ranges(*folder_storage(folder_ / "a"), "");
    change(*ranges.histogram);
    std::ofstream(folder_ / "a" / ranges_file("")) << to_json(ranges);
  }

  TemporaryFolder folder_;
};

TEST_F(StoredCounts, AreReadAsAHistogram) {
  const StoreReader reader = store();
  const SampleCounts expected = naive_counts(ScalarType::i16, samples_of(reader, 0));
  EXPECT_EQ(stored_counts(reader), expected);
  const Histogram h = *stored_histogram(reader);
  EXPECT_EQ(h.lo, expected.bins.lo);
  EXPECT_EQ(h.hi, expected.bins.hi);
  EXPECT_EQ(h.first, h.lo);
  EXPECT_EQ(h.bin_width, 1);
  EXPECT_TRUE(h.whole_numbers);
  EXPECT_EQ(h.level, 0);
  EXPECT_EQ(h.counts, expected.counts);
}

TEST_F(StoredCounts, AreNoPartThatAStoreNeeds) {
  drop_histogram(folder_ / "a");
  EXPECT_EQ(stored_histogram(store()), std::nullopt);
  NoProgress silent;
  EXPECT_EQ(verify(folder_ / "a", {.threads = 2}, silent).damage_count, 0u);
  EXPECT_EQ(histogram(store(), silent).level, 0);
}

TEST_F(StoredCounts, AreRefusedWhenTheyAreMissing) {
  fs::remove(chunk());
  expect_damaged("missing");
  fs::remove_all(folder_ / "a" / histogram_folder(""));
  expect_damaged("missing");
}

TEST_F(StoredCounts, AreRefusedWhenTheyAreDamaged) {
  std::string bytes = content_of(chunk());
  bytes[bytes.size() / 2] ^= 1;
  std::ofstream(chunk(), std::ios::binary) << bytes;
  expect_damaged("histogram/c/0");
}

TEST_F(StoredCounts, AreRefusedWhenTheyAreThoseOfAnotherStore) {
  convert(3, "b");
  fs::copy_file(chunk("b"), chunk(), fs::copy_options::overwrite_existing);
  fs::copy_file(folder_ / "b" / histogram_folder("") / "zarr.json",
                folder_ / "a" / histogram_folder("") / "zarr.json",
                fs::copy_options::overwrite_existing);
  expect_damaged("histogram");
  // With the right checksum too, they do not pass for those of these samples.
  const StoredHistogram other = *read_stored_ranges(*folder_storage(folder_ / "b"), "")->histogram;
  change_ranges([&](StoredHistogram& h) { h = other; });
  NoProgress silent;
  const VerifyReport report = verify(folder_ / "a", {.threads = 2}, silent);
  ASSERT_EQ(report.damage_count, 1u);
  EXPECT_EQ(report.damages[0], "level 0: its histogram is not that of its samples");
}

TEST_F(StoredCounts, AreRefusedWhenTheyCountOtherNumbersOfSamples) {
  change_ranges([](StoredHistogram& h) { h.bins.not_a_number = 1; });
  expect_damaged("counts 149241 samples, not the 149240 that there are");
}

TEST_F(StoredCounts, ImpossibleBinsAreDamage) {
  for (const auto& change : std::vector<std::function<void(HistogramBins&)>>{
           [](HistogramBins& bins) { bins.count = kMaxHistogramBins + 1; },
           [](HistogramBins& bins) { bins.count = -1; },
           [](HistogramBins& bins) { bins.exponent = 2000; },
           [](HistogramBins& bins) { bins.hi = bins.lo - 1; }}) {
    StoredRanges ranges;
    ranges.histogram = StoredHistogram{{.exponent = 0, .count = 10, .lo = 1, .hi = 10}, 5};
    EXPECT_EQ(parse_stored_ranges(to_json(ranges), "here"), ranges);
    change(ranges.histogram->bins);
    EXPECT_THROW(parse_stored_ranges(to_json(ranges), "here"), DamageError);
  }
}

TEST_F(StoredCounts, OfNoFiniteSample) {
  const std::vector<float> nan(100, std::numeric_limits<float>::quiet_NaN());
  MemorySource source({10, 5, 2}, ScalarType::f32, as_bytes(nan));
  convert_quietly(source, folder_ / "nan", {});
  NoProgress silent;
  EXPECT_EQ(verify(folder_ / "nan", {.threads = 1}, silent).damage_count, 0u);
  const Histogram h = *stored_histogram(store("nan"));
  EXPECT_TRUE(h.counts.empty());
  EXPECT_LT(h.hi, h.lo);
  EXPECT_EQ(h.not_a_number, 100u);
}

}  // namespace
}  // namespace isobrick::test
