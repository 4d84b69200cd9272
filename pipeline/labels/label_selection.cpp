#include "pipeline/labels/label_selection.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include <fmt/format.h>

#include <isobrick/error.h>

namespace isobrick::inline v0 {

LabelSelection::LabelSelection(std::vector<LabelRange> ranges, const Label& background)
    : ranges_(std::move(ranges)), background_(background) {
  for (const LabelRange& range : ranges_)
    if (range.last < range.first)
      throw UsageError(fmt::format("the range of labels {}:{} ends before it begins",
                                   range.first.text(), range.last.text()));
  std::sort(ranges_.begin(), ranges_.end(),
            [](const LabelRange& a, const LabelRange& b) { return a.first < b.first; });
  std::size_t kept = 0;
  for (const LabelRange& range : ranges_)
    if (kept > 0 && range.first <= ranges_[kept - 1].last)
      ranges_[kept - 1].last = std::max(ranges_[kept - 1].last, range.last);
    else
      ranges_[kept++] = range;
  ranges_.resize(kept);
}

bool LabelSelection::contains(const Label& label) const {
  if (ranges_.empty()) return label != background_;
  const auto after =
      std::upper_bound(ranges_.begin(), ranges_.end(), label,
                       [](const Label& l, const LabelRange& range) { return l < range.first; });
  return after != ranges_.begin() && label <= std::prev(after)->last;
}

bool LabelSelection::meets(double lo, double hi) const {
  // Beyond 2⁵³ several labels have the range [lo, hi].
  if (ranges_.empty()) {
    const auto background = static_cast<double>(background_);
    const bool is_exact = std::abs(background) < 0x1p53;
    return lo <= hi && (!is_exact || lo != background || hi != background);
  }
  // The first range that does not end before `lo`.
  const auto first = std::lower_bound(ranges_.begin(), ranges_.end(), lo,
                                      [](const LabelRange& range, double value) {
                                        return static_cast<double>(range.last) < value;
                                      });
  return first != ranges_.end() && static_cast<double>(first->first) <= hi;
}

}  // namespace isobrick
