#include "ranks/thread_ranks.h"

#include <gtest/gtest.h>

#include <atomic>
#include <set>

#include <isobrick/error.h>

namespace isobrick::test {
namespace {

Ranks::Bytes bytes_of(int value) { return to_bytes(std::span<const int>(&value, 1)); }
int value_of(const Ranks::Bytes& bytes) { return to_items<int>(bytes).front(); }

TEST(ThreadRanks, GatherAndExchangeGiveWhatEachRankSent) {
  for (const int size : {1, 2, 5})
    run_on_threads(size, [size](Ranks& ranks) {
      EXPECT_EQ(ranks.size(), size);
      EXPECT_EQ(ranks.node_rank(), ranks.rank());
      for (int turn = 0; turn < 20; ++turn) {
        const auto all = ranks.gather(bytes_of(100 * turn + ranks.rank()));
        std::vector<Ranks::Bytes> to;
        for (int i = 0; i < size; ++i) {
          EXPECT_EQ(value_of(all[static_cast<std::size_t>(i)]), 100 * turn + i);
          to.push_back(bytes_of(10 * ranks.rank() + i));
        }
        const auto got = ranks.exchange(to);
        for (int i = 0; i < size; ++i)
          EXPECT_EQ(value_of(got[static_cast<std::size_t>(i)]), 10 * i + ranks.rank());
      }
      EXPECT_EQ(ranks.bytes_received(), 20 * 2 * sizeof(int) * static_cast<unsigned>(size - 1));
    });
}

TEST(ThreadRanks, EachNumberIsDealtOnce) {
  std::atomic<int> sum = 0;
  run_on_threads(4, [&](Ranks& ranks) {
    for (int turn = 0; turn < 3; ++turn)
      deal(ranks, 100, [&](std::uint64_t i) { sum += static_cast<int>(i); });
  });
  EXPECT_EQ(sum, 3 * 4950);
}

TEST(ThreadRanks, AFailureEndsTheOthersAndIsThrown) {
  std::atomic<int> ended = 0;
  const auto fail_in_the_third_turn = [&](Ranks& ranks) {
    try {
      for (int turn = 0;; ++turn) {
        if (turn == 3 && ranks.rank() == 1) throw UsageError("no such level");
        if (turn % 2 == 0)
          ranks.wait_for_all();
        else
          ranks.next(0);
      }
    } catch (const Error&) {
      ++ended;
      throw;
    }
  };
  EXPECT_THROW(run_on_threads(3, fail_in_the_third_turn), UsageError);
  EXPECT_EQ(ended, 3);
}

}  // namespace
}  // namespace isobrick::test
