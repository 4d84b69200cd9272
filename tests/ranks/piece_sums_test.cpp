#include "ranks/piece_sums.h"

#include <gtest/gtest.h>

#include <isobrick/extract.h>
#include "ranks/thread_ranks.h"

namespace isobrick::inline v0 {
namespace {

/// Of piece number i.
ExtractReport piece(std::uint64_t i) {
  ExtractReport report;
  report.bricks_read = i;
  report.bytes_read = std::uint64_t{1} << (40 + i);
  report.plan_seconds = 0.25 * static_cast<double>(i);
  report.kernel = {0.5 * static_cast<double>(i), 100 * i};
  report.bricks = 7;  // is not added up
  return report;
}

PieceSums<ExtractReport> no_sums() {
  return PieceSums<ExtractReport>({{&ExtractReport::bricks_read, &ExtractReport::bytes_read},
                                   {&ExtractReport::plan_seconds},
                                   {&ExtractReport::kernel}});
}

void expect_sums(const PieceSums<ExtractReport>& sums) {
  EXPECT_EQ(sums.kept(), 2u);
  ExtractReport report;
  report.bricks = 5;
  report.bricks_read = 1000;
  sums.put(report);
  EXPECT_EQ(report.bricks, 5u);
  EXPECT_EQ(report.bricks_read, 10u);
  EXPECT_EQ(report.bytes_read, std::uint64_t{0b11111} << 40);
  EXPECT_EQ(report.plan_seconds, 2.5);
  EXPECT_EQ(report.kernel.seconds, 5);
  EXPECT_EQ(report.kernel.bytes, 1000u);
}

TEST(PieceSums, AreThoseOfAllPieces) {
  PieceSums sums = no_sums();
  for (std::uint64_t i = 0; i < 5; ++i) sums.add(piece(i), i < 2);
  expect_sums(sums);
}

TEST(PieceSums, AreTheSameOnEachRank) {
  run_on_threads(3, [](Ranks& ranks) {
    PieceSums sums = no_sums();
    for (std::uint64_t i = 0; i < 5; ++i)
      if (i % 3 == static_cast<std::uint64_t>(ranks.rank())) sums.add(piece(i), i < 2);
    sums.gather(ranks);
    expect_sums(sums);
  });
}

}  // namespace
}  // namespace isobrick
