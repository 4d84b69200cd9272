#include "io/volumes/selected_source.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <numeric>
#include <vector>

#include <isobrick/error.h>
#include <isobrick/lattice.h>
#include "tests/pipeline/convert_doubles.h"

namespace isobrick::test {
namespace {

constexpr Int3 kStoredExtent{11, 7, 9};

/// Sample (x, y, z) has its place in the array for its value.
std::unique_ptr<MemorySource> numbered(bool random_access) {
  std::vector<std::uint16_t> values(static_cast<std::size_t>(volume(kStoredExtent)));
  std::iota(values.begin(), values.end(), std::uint16_t{0});
  std::vector<std::byte> bytes(values.size() * 2);
  std::memcpy(bytes.data(), values.data(), bytes.size());
  auto source = std::make_unique<MemorySource>(kStoredExtent, ScalarType::u16, std::move(bytes),
                                               random_access);
  source->mutable_info().transform.spacing = {0.5, 2, 1};
  source->mutable_info().transform.origin = {10, 20, 30};
  return source;
}

/// All samples, read in pieces of `planes`.
template <class T>
std::vector<T> read_all(VolumeSource& source, Index planes) {
  const Int3 e = source.info().extent;
  std::vector<T> values(static_cast<std::size_t>(volume(e)));
  for (Index z = 0; z < e.z; z += planes)
    source.read({{0, 0, z}, {e.x, e.y, std::min(e.z, z + planes)}},
                reinterpret_cast<std::byte*>(values.data() + z * e.y * e.x));
  return values;
}

TEST(SelectedSource, BoxesAndStridesOfRandomAccessAndOfStreams) {
  for (const bool random_access : {true, false})
    for (const Int3 stride : {Int3{1, 1, 1}, Int3{2, 1, 3}, Int3{4, 4, 4}, Int3{20, 20, 20}})
      for (const Box3 whole_box : {Box3{{0, 0, 0}, kStoredExtent}, Box3{{3, 2, 4}, {10, 7, 8}},
                                   Box3{{0, 0, 8}, {11, 7, 9}}})
        for (const Index planes : {1, 2, 9}) {
          // The box counts what the stride leaves.
          const Box3 all{{0, 0, 0}, ceil_div(kStoredExtent, stride)};
          const Box3 box = intersect(whole_box, all);
          if (box.empty()) continue;
          VolumeRequest request;
          request.roi.emplace();
          for (std::size_t axis = 0; axis < 3; ++axis) {
            request.roi->lo[axis] = box.lo[static_cast<int>(axis)];
            request.roi->hi[axis] = box.hi[static_cast<int>(axis)];
          }
          request.stride = stride;
          const auto source = select_samples(numbered(random_access), request);
          const VolumeInfo& info = source->info();
          ASSERT_EQ(info.extent, box.extent());
          EXPECT_EQ(source->random_access(), random_access);
          std::vector<std::uint16_t> expected;
          for_each_point(box, [&](Int3 p) {
            expected.push_back(static_cast<std::uint16_t>(linear_index(p * stride, kStoredExtent)));
          });
          EXPECT_EQ(read_all<std::uint16_t>(*source, planes), expected);
          // A sample stays where it was in the world.
          const Vec3d origin{10 + 0.5 * static_cast<double>(box.lo.x * stride.x),
                             20 + 2.0 * static_cast<double>(box.lo.y * stride.y),
                             30 + static_cast<double>(box.lo.z * stride.z)};
          EXPECT_EQ(info.transform.origin, origin);
          EXPECT_EQ(info.transform.spacing.x, 0.5 * static_cast<double>(stride.x));
        }
}

TEST(SelectedSource, ABoxInsideIsReadAsThatBox) {
  VolumeRequest request;
  request.stride = {3, 2, 2};
  const auto source = select_samples(numbered(true), request);
  std::vector<std::uint16_t> values(4);
  source->read({{1, 1, 2}, {3, 3, 3}}, reinterpret_cast<std::byte*>(values.data()));
  EXPECT_EQ(values, (std::vector<std::uint16_t>{
                        static_cast<std::uint16_t>(linear_index({3, 2, 4}, kStoredExtent)),
                        static_cast<std::uint16_t>(linear_index({6, 2, 4}, kStoredExtent)),
                        static_cast<std::uint16_t>(linear_index({3, 4, 4}, kStoredExtent)),
                        static_cast<std::uint16_t>(linear_index({6, 4, 4}, kStoredExtent))}));
}

TEST(SelectedSource, ARegionOfTheWorldIsCovered) {
  VolumeRequest request;
  // Between samples 2 and 6 in x, at samples 1 and 3 in y, beyond the volume in z.
  request.region = WorldRegion{{11.2, 22, -100}, {12.7, 26, 33.5}};
  const auto source = select_samples(numbered(true), request);
  EXPECT_EQ(source->info().extent, (Int3{5, 3, 5}));
  EXPECT_EQ(source->info().transform.origin, (Vec3d{11, 22, 30}));
  request.region = WorldRegion{{0, 0, 0}, {1, 1, 1}};
  EXPECT_THROW(select_samples(numbered(true), request), UsageError);
  request.stride = {0, 1, 1};
  request.region.reset();
  EXPECT_THROW(select_samples(numbered(true), request), UsageError);
}

TEST(SelectedSource, ARegionOfTurnedAxesIsInTheBoxAroundIt) {
  Transform turned;
  turned.direction = {0, -1, 0, 1, 0, 0, 0, 0, 1};  // x points to y, y to -x
  EXPECT_EQ(covering_samples({{-3, 1, 0}, {-2, 5, 4}}, turned, {10, 10, 10}),
            (Box3{{1, 2, 0}, {6, 4, 5}}));
}

TEST(SelectedSource, MissingSamplesBecomeNaN) {
  for (const bool random_access : {true, false}) {
    VolumeRequest request;
    request.nodata = 17;
    const auto source = select_samples(numbered(random_access), request);
    ASSERT_EQ(source->info().type, ScalarType::f32);
    const auto values = read_all<float>(*source, 2);
    for (std::size_t i = 0; i < values.size(); ++i)
      if (i == 17)
        EXPECT_TRUE(std::isnan(values[i]));
      else
        EXPECT_EQ(values[i], static_cast<float>(i));
  }
}

TEST(SelectedSource, AMissingFillValueIsNaN) {
  auto source = numbered(true);
  source->mutable_info().fill_value = 5;
  VolumeRequest request;
  request.nodata = 5;
  EXPECT_TRUE(std::isnan(select_samples(std::move(source), request)->info().fill_value));
}

TEST(SelectedSource, WhatSelectsAllIsTheSourceItself) {
  auto source = numbered(true);
  const VolumeSource* before = source.get();
  EXPECT_EQ(select_samples(std::move(source), {}).get(), before);
}

TEST(SelectedSource, MissingFloatsAreThoseOfTheNearestNumber) {
  const Int3 extent{4, 1, 1};
  const std::vector<float> values{1, -1e30F, 0.1F, 2};
  for (const auto& [nodata, missing] :
       {std::pair{-1e30, 1}, std::pair{0.1, 2}, std::pair{1e300, -1}}) {
    std::vector<std::byte> bytes(sizeof(float) * values.size());
    std::memcpy(bytes.data(), values.data(), bytes.size());
    VolumeRequest request;
    request.nodata = nodata;
    const auto source = select_samples(
        std::make_unique<MemorySource>(extent, ScalarType::f32, std::move(bytes), true), request);
    const std::vector<float> read = read_all<float>(*source, 1);
    for (int i = 0; i < 4; ++i)
      EXPECT_EQ(std::isnan(read[static_cast<std::size_t>(i)]), i == missing) << nodata;
  }
}

}  // namespace
}  // namespace isobrick::test
