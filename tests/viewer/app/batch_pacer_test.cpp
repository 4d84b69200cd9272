#include "viewer/app/batch_pacer.h"

#include <gtest/gtest.h>

#include <cstdint>

namespace isobrick::inline v0 {
namespace {

constexpr double kLimit = 0.05;

/// Time of a batch with `rate` work a second and a fixed cost of a millisecond.
double seconds_of(std::uint64_t work, double rate) {
  return 1e-3 + static_cast<double>(work) / rate;
}

TEST(BatchPacer, BatchesTakeMostOfTheirTime) {
  for (const double rate : {3e5, 4e6, 1e8}) {
    BatchPacer pacer;
    for (int i = 0; i < 40; ++i) pacer.add(seconds_of(pacer.work(), rate), kLimit);
    EXPECT_LE(seconds_of(pacer.work(), rate), kLimit) << rate;
    EXPECT_GE(seconds_of(pacer.work(), rate), 0.7 * kLimit) << rate;
  }
}

TEST(BatchPacer, WhatHasBecomeSlowIsHalvedAtOnce) {
  BatchPacer pacer;
  for (int i = 0; i < 10; ++i) pacer.add(0.001, kLimit);
  const std::uint64_t before = pacer.work();
  pacer.add(0.5, kLimit);
  EXPECT_EQ(pacer.work(), before / 2);
  for (int i = 0; i < 100; ++i) pacer.add(1, kLimit);
  EXPECT_GE(pacer.work(), 1000u)
      << "the fixed cost of batches must not make them smaller and smaller";
}

}  // namespace
}  // namespace isobrick
