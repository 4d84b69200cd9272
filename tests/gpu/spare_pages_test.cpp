#include "isobrick/gpu/spare_pages.h"

#include <gtest/gtest.h>

#include <vector>

#include "isobrick/gpu/device.h"

namespace isobrick::gpu {
namespace {

using Sizes = std::vector<std::size_t>;

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

TEST_F(SparePagesOnADevice, GoWhenOthersAreWantedOrThereAreSuch) {
  SparePages spare(1 << 20);
  spare.give(locked({4096}));
  spare.give(locked({4096}));
  EXPECT_TRUE(spare.take(0, {4096}));
  EXPECT_FALSE(spare.take(0, {4096}));
  spare.give(locked({4096}));
  EXPECT_FALSE(spare.take(0, {8192}));
  EXPECT_FALSE(spare.take(0, {4096}));
  spare.give(locked({4096}));
  spare.drop();
  EXPECT_FALSE(spare.take(0, {4096}));
}

TEST_F(SparePagesOnADevice, AreNoMoreThanWasSaid) {
  SparePages spare(8192);
  spare.give(locked({4096}));
  spare.give(locked({8192}));
  EXPECT_TRUE(spare.take(0, {4096}));
  EXPECT_FALSE(spare.take(0, {8192}));
}

}  // namespace
}  // namespace isobrick::gpu
