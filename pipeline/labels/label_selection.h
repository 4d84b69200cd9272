#pragma once

#include <cstdint>
#include <vector>

#include <isobrick/labels.h>

namespace isobrick::inline v0 {

/// The labels that are chosen.
class LabelSelection {
 public:
  /// Throws UsageError for a range that ends before it begins.
  LabelSelection(std::vector<LabelRange> ranges, std::int64_t background);

  bool contains(std::int64_t label) const;
  /// Whether these are some labels, and not all but the background.
  bool is_some() const { return !ranges_.empty(); }
  /// Whether a label from `lo` to `hi` may be chosen.
  bool meets(double lo, double hi) const;
  /// In ascending order, disjoint; none: all but the background.
  const std::vector<LabelRange>& ranges() const { return ranges_; }

 private:
  std::vector<LabelRange> ranges_;
  std::int64_t background_;
};

}  // namespace isobrick
