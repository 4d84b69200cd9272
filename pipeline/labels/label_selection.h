#pragma once

#include <cstdint>
#include <vector>

#include <isobrick/labels.h>

namespace isobrick::inline v0 {

/// The labels that are chosen.
class LabelSelection {
 public:
  /// Throws UsageError for a range that ends before it begins.
  LabelSelection(std::vector<LabelRange> ranges, const Label& background);

  bool contains(const Label& label) const;
  /// Whether these are some labels, and not all but the background.
  bool is_some() const { return !ranges_.empty(); }
  /// Whether a label from `lo` to `hi` may be chosen, ends of surface_range().
  bool meets(double lo, double hi) const;
  /// In ascending order, disjoint; none: all but the background.
  const std::vector<LabelRange>& ranges() const { return ranges_; }

 private:
  std::vector<LabelRange> ranges_;
  Label background_;
};

}  // namespace isobrick
