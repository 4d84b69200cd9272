#pragma once

#include <bit>
#include <cstdint>
#include <vector>

// Sinks take the answers of a query. A traversal calls, in its own order:
//   ids(list, n)       n ids that lie one after the other.
//   id(i)              One id.
//   bits(first, word)  first + b for each set bit b.
// It also reports its steps:
//   node()             It visits a node.
//   tested(n)          It compares the ranges of n items.

namespace isobrick::inline v0 {

struct QuietSink {
  void node() {}
  void tested(std::uint64_t) {}
};

class AppendSink : public QuietSink {
 public:
  explicit AppendSink(std::vector<std::uint32_t>& out) : out_(out) {}
  void ids(const std::uint32_t* list, std::uint32_t n) { out_.insert(out_.end(), list, list + n); }
  void id(std::uint32_t i) { out_.push_back(i); }
  void bits(std::uint32_t first, std::uint64_t word) {
    for (; word; word &= word - 1)
      out_.push_back(first + static_cast<std::uint32_t>(std::countr_zero(word)));
  }

 private:
  std::vector<std::uint32_t>& out_;
};

class CountSink : public QuietSink {
 public:
  void ids(const std::uint32_t*, std::uint32_t n) { count_ += n; }
  void id(std::uint32_t) { ++count_; }
  void bits(std::uint32_t, std::uint64_t word) {
    count_ += static_cast<std::uint64_t>(std::popcount(word));
  }
  std::uint64_t count() const { return count_; }

 private:
  std::uint64_t count_ = 0;
};

/// Sets bit `id & 63` of word `id >> 6`.
class MarkSink : public QuietSink {
 public:
  explicit MarkSink(std::uint64_t* words) : words_(words) {}
  void ids(const std::uint32_t* list, std::uint32_t n) {
    for (std::uint32_t i = 0; i < n; ++i) id(list[i]);
  }
  void id(std::uint32_t i) { words_[i >> 6] |= std::uint64_t{1} << (i & 63); }
  /// `first` is a multiple of 64: only the linear scan has words.
  void bits(std::uint32_t first, std::uint64_t word) { words_[first >> 6] |= word; }

 private:
  std::uint64_t* words_;
};

/// The work of one query.
struct QuerySteps {
  std::uint64_t nodes = 0;   ///< looked at; probes of a list's values count, too
  std::uint64_t tested = 0;  ///< items whose range was compared one by one
  std::uint64_t runs = 0;    ///< lists reported without looking at their items
  std::uint64_t answers = 0;
};

class StepsSink {
 public:
  void node() { ++steps_.nodes; }
  void tested(std::uint64_t n) { steps_.tested += n; }
  void ids(const std::uint32_t*, std::uint32_t n) {
    ++steps_.runs;
    steps_.answers += n;
  }
  void id(std::uint32_t) { ++steps_.answers; }
  void bits(std::uint32_t, std::uint64_t word) {
    steps_.answers += static_cast<std::uint64_t>(std::popcount(word));
  }
  const QuerySteps& steps() const { return steps_; }

 private:
  QuerySteps steps_;
};

}  // namespace isobrick
