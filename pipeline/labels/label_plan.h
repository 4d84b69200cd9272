#pragma once

#include <cstddef>
#include <cstdint>

#include <isobrick/labels.h>
#include "surface/labels/label_points.h"

namespace isobrick::inline v0 {

/// The least for what is known of each label: for 10,000 labels.
inline constexpr std::uint64_t kLeastForLabels = std::uint64_t{4} << 20;

/// How an extraction of labels divides its memory budget.
struct LabelPlan {
  int threads = 1;
  std::size_t tiles = 1;          ///< that are under way at a time
  std::size_t cache_bricks = 0;   ///< decoded bricks
  std::size_t batch_bricks = 0;   ///< that a batch of tiles may need
  std::uint64_t label_bytes = 0;  ///< for what is known of each label
  std::size_t meshes = 1;         ///< that are passed on at a time
};

/// How the points of labels are smoothed. Throws UsageError for what makes no sense.
LabelSmoothing label_smoothing(const LabelOptions& options);

/// Throws UsageError naming the least budget that works when this one does not.
LabelPlan plan_label_memory(const StoreReader& store, const LabelOptions& options);
/// The same of samples of a type without a store, which take `source_bytes`.
LabelPlan plan_label_memory(ScalarType type, std::uint64_t source_bytes,
                            const LabelOptions& options);

}  // namespace isobrick
