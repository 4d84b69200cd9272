#include "filters/collapse_spool.h"

#include <algorithm>
#include <bit>

namespace isobrick::inline v0 {

CollapseSpool::CollapseSpool(const ScratchPlace& place, std::uint64_t memory)
    : collapses_(place, memory), counts_(kBins) {}

std::size_t CollapseSpool::bin(float error) {
  return std::bit_cast<std::uint32_t>(error) >> kShift;
}

void CollapseSpool::add(std::span<const Collapse> collapses) {
  collapses_.append(collapses);
  for (const Collapse& c : collapses) ++counts_[bin(c.error)];
  begin_.push_back(collapses_.size());
}

void CollapseSpool::select(std::uint64_t count) {
  std::size_t last = 0;  // the bin of which a part is selected
  for (; last + 1 < kBins && counts_[last] <= count; ++last) count -= counts_[last];
  selected_.clear();
  for (std::size_t group = 0; group + 1 < begin_.size(); ++group) {
    std::uint64_t below = 0, in_last = 0;
    collapses_.for_each_run(begin_[group], begin_[group + 1],
                            [&](std::span<const Collapse> run, std::uint64_t) {
                              for (const Collapse& c : run) {
                                below += bin(c.error) < last;
                                in_last += bin(c.error) == last;
                              }
                            });
    const std::uint64_t part = std::min(in_last, count);
    count -= part;
    selected_.push_back(below + part);
  }
}

std::vector<Collapse> CollapseSpool::load(std::size_t group) {
  std::vector<Collapse> loaded;
  collapses_.for_each_run(begin_[group], begin_[group] + selected_[group],
                          [&](std::span<const Collapse> run, std::uint64_t) {
                            loaded.insert(loaded.end(), run.begin(), run.end());
                          });
  return loaded;
}

void CollapseSpool::clear() {
  collapses_.clear();
  begin_.assign(1, 0);
  selected_.clear();
  std::ranges::fill(counts_, 0);
}

void CollapseSpool::release() {
  clear();
  collapses_.release();
}

}  // namespace isobrick
