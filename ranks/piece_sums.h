#pragma once

#include <bit>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <isobrick/surface_report.h>
#include "ranks/ranks.h"

namespace isobrick::inline v0 {

/// Members of a report that are added up: counts, times and stages.
template <class Report>
struct SummedMembers {
  std::vector<std::uint64_t Report::*> counts;
  std::vector<double Report::*> seconds = {};
  std::vector<StageReport Report::*> stages = {};
};

/// What pieces took together, those of this rank and of the others.
template <class Report>
class PieceSums {
 public:
  explicit PieceSums(SummedMembers<Report> members) : members_(std::move(members)) {}

  void add(const Report& piece, bool is_kept) {
    kept_ += is_kept;
    for (const auto member : members_.counts) sums_.*member += piece.*member;
    for (const auto member : members_.seconds) sums_.*member += piece.*member;
    for (const auto member : members_.stages) {
      (sums_.*member).seconds += (piece.*member).seconds;
      (sums_.*member).bytes += (piece.*member).bytes;
    }
  }

  /// Collective: adds up what all ranks have, so that each has the sums.
  void gather(Ranks& ranks) {
    const std::vector<std::uint64_t> own = numbers();
    const auto all = ranks.gather(std::as_bytes(std::span(own)));
    kept_ = 0;
    sums_ = {};
    for (const Ranks::Bytes& of_rank : all) add_numbers(to_items<std::uint64_t>(of_rank));
  }

  /// Pieces that were there already.
  std::uint64_t kept() const { return kept_; }
  /// Sets the members that are added up.
  void put(Report& report) const {
    for (const auto member : members_.counts) report.*member = sums_.*member;
    for (const auto member : members_.seconds) report.*member = sums_.*member;
    for (const auto member : members_.stages) report.*member = sums_.*member;
  }

 private:
  /// All sums, times as their bits.
  std::vector<std::uint64_t> numbers() const {
    std::vector<std::uint64_t> all{kept_};
    const auto add_seconds = [&](double value) {
      all.push_back(std::bit_cast<std::uint64_t>(value));
    };
    for (const auto member : members_.counts) all.push_back(sums_.*member);
    for (const auto member : members_.seconds) add_seconds(sums_.*member);
    for (const auto member : members_.stages) {
      add_seconds((sums_.*member).seconds);
      all.push_back((sums_.*member).bytes);
    }
    return all;
  }

  void add_numbers(const std::vector<std::uint64_t>& numbers) {
    auto next = numbers.begin();
    kept_ += *next++;
    for (const auto member : members_.counts) sums_.*member += *next++;
    for (const auto member : members_.seconds) sums_.*member += std::bit_cast<double>(*next++);
    for (const auto member : members_.stages) {
      (sums_.*member).seconds += std::bit_cast<double>(*next++);
      (sums_.*member).bytes += *next++;
    }
  }

  SummedMembers<Report> members_;
  std::uint64_t kept_ = 0;
  Report sums_;
};

}  // namespace isobrick
