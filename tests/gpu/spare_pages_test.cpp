#include "isobrick/gpu/spare_pages.h"

#include <gtest/gtest.h>

#include <vector>

#include "isobrick/gpu/device.h"

namespace isobrick::gpu {
namespace {

using Sizes = SparePages::Sizes;

LockedPieces locked(const Sizes& sizes) {
  LockedPieces pieces(0, sizes);
  for (std::size_t i = 0; i < pieces.count(); ++i) {
    MappedPages::touch(pieces.at(i), pieces.bytes(i));
    pieces.lock_next();
  }
  return pieces;
}

TEST(LockedPieces, BeginAtPagesOneAfterTheOther) {
  const LockedPieces pieces(0, {5000, 1, 4096});
  ASSERT_EQ(pieces.count(), 3u);
  EXPECT_EQ(pieces.bytes(0), 8192u);
  EXPECT_EQ(pieces.bytes(1), 4096u);
  EXPECT_EQ(pieces.at(1), pieces.at(0) + 8192);
  EXPECT_EQ(pieces.at(2), pieces.at(1) + 4096);
  EXPECT_EQ(pieces.bytes(), 16384u);
  EXPECT_FALSE(pieces.all_locked());
  EXPECT_TRUE(pieces.are(0, {8192, 4096, 4096}));
  EXPECT_FALSE(pieces.are(1, {8192, 4096, 4096}));
  EXPECT_FALSE(pieces.are(0, {8192, 4096}));
}

TEST(SparePages, WhatIsNotLockedIsNotKept) {
  SparePages spare(1 << 20);
  spare.keep_only(0, {{4096}});
  spare.give(LockedPieces(0, {4096}));
  EXPECT_FALSE(spare.take(0, {4096}));
}

class SparePagesOnADevice : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!device_available()) GTEST_SKIP() << "no device";
    open_device(0);
  }
};

TEST_F(SparePagesOnADevice, AreTakenOnceByWhoeverWantsTheirSizes) {
  SparePages spare(1 << 20);
  spare.keep_only(0, {{4096}, {8192, 4096}});
  LockedPieces first = locked({4096}), second = locked({8192, 4096});
  const std::byte *const one = first.at(0), *const two = second.at(0);
  spare.give(std::move(first));
  spare.give(std::move(second));
  const auto taken = spare.take(0, {8192, 4096}), other = spare.take(0, {4096});
  ASSERT_TRUE(taken && other);
  EXPECT_EQ(taken->at(0), two);
  EXPECT_EQ(other->at(0), one);
  EXPECT_TRUE(taken->all_locked());
  EXPECT_FALSE(spare.take(0, {4096}));
}

TEST_F(SparePagesOnADevice, OnlyWhatIsWantedIsKeptAndThatOnce) {
  SparePages spare(1 << 20);
  spare.give(locked({4096}));
  EXPECT_EQ(spare.bytes(), 0u);
  spare.keep_only(0, {{4096}, {8192}});
  for (const Sizes& sizes : {Sizes{4096}, Sizes{4096}, Sizes{8192}, Sizes{12288}})
    spare.give(locked(sizes));
  EXPECT_EQ(spare.bytes(), 12288u);
  EXPECT_FALSE(spare.take(0, {12288}));
  EXPECT_EQ(spare.bytes(), 12288u) << "others stay, of which they are taken next";
}

TEST_F(SparePagesOnADevice, GoWhenWhatBeginsDoesNotAskForThem) {
  SparePages spare(1 << 20);
  const auto fill = [&] {
    spare.keep_only(0, {{4096}, {8192}});
    spare.give(locked({4096}));
    spare.give(locked({8192}));
    EXPECT_EQ(spare.bytes(), 12288u);
  };
  fill();
  spare.keep_only(0, {{8192}, {12288}});
  EXPECT_EQ(spare.bytes(), 8192u);
  EXPECT_TRUE(spare.take(0, {8192}));
  fill();
  spare.keep_only(1, {{4096}, {8192}});
  EXPECT_EQ(spare.bytes(), 0u) << "another device";
  fill();
  LockedPieces in_use = *spare.take(0, {4096});
  spare.drop();
  EXPECT_EQ(spare.bytes(), 0u);
  spare.give(std::move(in_use));
  EXPECT_EQ(spare.bytes(), 0u);
}

TEST_F(SparePagesOnADevice, AreNoneWhereAllThatIsWantedIsTooMuch) {
  SparePages spare(8192);
  spare.keep_only(0, {{4096}, {8192}});
  spare.give(locked({4096}));
  EXPECT_EQ(spare.bytes(), 0u);
  spare.keep_only(0, {{4096}, {4000}});
  spare.give(locked({4096}));
  EXPECT_EQ(spare.bytes(), 4096u);
  spare.keep_only(0, {{4096}, {8192}});
  EXPECT_EQ(spare.bytes(), 0u);
}

}  // namespace
}  // namespace isobrick::gpu
