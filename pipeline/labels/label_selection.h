#pragma once

#include <cstdint>
#include <vector>

#include <isobrick/labels.h>

namespace isobrick::inline v0 {

/// The labels that are chosen.
class LabelSelection {
 public:
  /// Throws UsageError for a range that ends before it begins.
  LabelSelection(std::vector<LabelRange> ranges, std::int64_t background,
                 ScalarType type = ScalarType::i64);

  /// `label` as label_of() returns it for a sample of the type. Throws Error for a label without a
  /// mesh where all are chosen.
  bool contains(std::int64_t label) const;
  /// Whether these are some labels, and not all but the background.
  bool is_some() const { return !ranges_.empty(); }
  /// Whether a label from `lo` to `hi` may be chosen, ends of surface_range().
  bool meets(double lo, double hi) const;
  /// In ascending order, disjoint; none: all but the background.
  const std::vector<LabelRange>& ranges() const { return ranges_; }

 private:
  std::vector<LabelRange> ranges_;
  std::int64_t background_;
  bool is_unsigned_;
};

}  // namespace isobrick
