#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "filters/edge_collapse.h"
#include "filters/scratch_array.h"

namespace isobrick::inline v0 {

/// The collapses of many groups, of which those of the smallest errors are selected.
class CollapseSpool {
 public:
  CollapseSpool(const ScratchPlace& place, std::uint64_t memory);

  /// Adds those of the next group; errors ascend.
  void add(std::span<const Collapse> collapses);
  /// Selects the first collapses of each group, so many of all groups together, or all where there
  /// are fewer. Among equal errors those of earlier groups come first.
  void select(std::uint64_t count);
  /// The selected collapses of a group.
  std::vector<Collapse> load(std::size_t group);

  void clear();
  void release();
  std::uint64_t memory() const { return collapses_.memory() + sizeof(std::uint64_t) * kBins; }
  std::uint64_t file_bytes() const { return collapses_.file_bytes(); }

 private:
  /// Errors are counted by their leading bits: 2^11 bins for each factor of 2.
  static constexpr unsigned kShift = 12;
  static constexpr std::size_t kBins = std::size_t{1} << (31 - kShift);

  static std::size_t bin(float error);

  ScratchArray<Collapse> collapses_;
  std::vector<std::uint64_t> begin_{0};  ///< of each group, and the end
  std::vector<std::uint64_t> counts_;    ///< of each bin
  std::vector<std::uint64_t> selected_;  ///< of each group
};

}  // namespace isobrick
