#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <stdexcept>
#include <vector>

#include <isobrick/error.h>
#include <isobrick/isovalue.h>
#include <isobrick/volume_extractor.h>
#include "tests/pipeline/naive_counts.h"
#include "tests/surface/field.h"

// The histogram of a volume without a store.
namespace isobrick::inline v0 {
namespace {

using test::naive_counts;
using testing::Field;

template <class T>
Volume volume_of(const Field<T>& field) {
  return Volume::of(field.samples.data(), field.extent);
}

/// The same behind a function.
template <class T>
Volume read_volume(const Field<T>& field) {
  Volume volume{.type = scalar_type_of<T>, .extent = field.extent};
  volume.read = [&field](Box3 box, void* out) {
    auto* to = static_cast<T*>(out);
    for_each_point(box, [&](Int3 p) { *to++ = field.at(p); });
  };
  return volume;
}

void expect_counts(const Histogram& histogram, const SampleCounts& expected) {
  EXPECT_EQ(histogram.counts, expected.counts);
  EXPECT_EQ(histogram.lo, expected.bins.lo);
  EXPECT_EQ(histogram.hi, expected.bins.hi);
  EXPECT_EQ(histogram.not_a_number, expected.bins.not_a_number);
  EXPECT_EQ(histogram.infinite, expected.bins.infinite);
  EXPECT_EQ(histogram.level, 0);
}

template <class T>
class VolumeHistogram : public ::testing::Test {};
using Types = ::testing::Types<std::uint8_t, std::int16_t, std::uint32_t, float, double>;
TYPED_TEST_SUITE(VolumeHistogram, Types);

TYPED_TEST(VolumeHistogram, CountsAllSamplesOnce) {
  for (const Int3 extent : {Int3{1, 1, 1}, Int3{150, 7, 3}, Int3{33, 140, 129}}) {
    const auto field = testing::padded_noise<TypeParam>(extent, 0, 100, TypeParam{0}, 7);
    const auto expected = naive_counts<TypeParam>(field.samples);
    for (const int threads : {1, 3})
      expect_counts(VolumeExtractor(volume_of(field)).histogram(threads), expected);
    expect_counts(VolumeExtractor(read_volume(field)).histogram(), expected);
  }
}

TYPED_TEST(VolumeHistogram, TakesAnyStrides) {
  const Int3 extent{40, 50, 30};
  const auto field = testing::padded_noise<TypeParam>(extent, 0, 100, TypeParam{0}, 7);
  Volume volume = volume_of(field);
  constexpr Index size = sizeof(TypeParam);
  volume.samples = field.samples.data() + field.samples.size() - 1;
  volume.extent = {extent.z, extent.y, extent.x};
  volume.strides = Int3{extent.x * extent.y, extent.x, 1} * -size;
  expect_counts(VolumeExtractor(volume).histogram(), naive_counts<TypeParam>(field.samples));
}

TEST(VolumeHistogramTest, MissingSamplesCountAsNan) {
  auto field = testing::padded_noise<std::uint8_t>({40, 50, 60}, 0, 100, 0, 3);
  std::vector<std::uint8_t> mask(field.samples.size(), 1);
  std::vector<float> expected(field.samples.begin(), field.samples.end());
  for (std::size_t i = 0; i < mask.size(); i += 3) {
    mask[i] = 0;
    expected[i] = std::numeric_limits<float>::quiet_NaN();
  }
  for (float& sample : expected)
    if (sample == 42) sample = std::numeric_limits<float>::quiet_NaN();
  for (Volume volume : {volume_of(field), read_volume(field)}) {
    volume.mask = mask.data();
    volume.nodata = 42;
    expect_counts(VolumeExtractor(volume).histogram(), naive_counts<float>(expected));
  }
}

TEST(VolumeHistogramTest, GivesIsovalues) {
  auto field = testing::padded_noise<std::uint8_t>({40, 50, 60}, 0, 10, 0, 3);
  for (std::size_t i = 0; i < field.samples.size(); i += 2) field.samples[i] += 100;
  VolumeExtractor extractor(volume_of(field));
  int calls = 0;
  const auto samples = [&] {
    ++calls;
    return extractor.histogram();
  };
  const auto isovalues =
      resolve_isovalues(parse_isovalues("otsu,3,otsu,p0"), ScalarType::u8, samples);
  ASSERT_EQ(isovalues.size(), 3u);
  EXPECT_GT(isovalues[0], 9);
  EXPECT_LT(isovalues[0], 100);
  EXPECT_EQ(isovalues[1], 3);
  EXPECT_EQ(calls, 1);
  EXPECT_EQ(resolve_isovalues(parse_isovalues("1,2"), ScalarType::u8, samples),
            (std::vector<double>{1, 2}));
  EXPECT_EQ(calls, 1);
  EXPECT_TRUE(suggest_isovalue(ScalarType::u8, extractor.histogram()));
}

TEST(VolumeHistogramTest, EndsWithWhatProgressAndReadThrow) {
  struct Ends final : Progress {
    void begin(std::string_view, std::uint64_t) override {}
    void advance(std::uint64_t) override { throw Cancelled("ended"); }
    void end() override {}
  } ends;
  const auto field = testing::padded_noise<float>({40, 50, 60}, 0, 100, 0, 3);
  EXPECT_THROW(VolumeExtractor(volume_of(field)).histogram(0, ends), Cancelled);
  EXPECT_THROW(VolumeExtractor(read_volume(field)).histogram(0, ends), Cancelled);
  Volume volume = read_volume(field);
  volume.read = [](Box3, void*) { throw std::runtime_error("no disk"); };
  EXPECT_THROW(VolumeExtractor(volume).histogram(), std::runtime_error);
}

}  // namespace
}  // namespace isobrick
