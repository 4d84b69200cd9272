#pragma once

#include <isobrick/labels.h>
#include "core/tile_range.h"
#include "pipeline/labels/label_image.h"
#include "pipeline/labels/label_pass.h"
#include "pipeline/labels/label_plan.h"
#include "stream/tile_stream.h"

namespace isobrick::inline v0 {

/// What `options` request of a store. Throws UsageError for a level, region or range of labels that
/// makes no sense.
LabelImage label_image_of(const StoreReader& store, const LabelOptions& options);

/// The tiles of `range` that may have a piece of a chosen label, by the ranges of blocks and, with
/// `uses_lists`, the store's lists of labels. The store and the image must outlive them.
TileStream label_tiles(const StoreReader& store, int level, const LabelImage& image,
                       const TileRange& range, bool uses_lists);

/// Makes the pieces of these tiles. What was read of the store is in the report.
LabelReport run_label_pass(const StoreReader& store, const LabelOptions& options,
                           const LabelImage& image, const LabelPlan& plan, const TileRange& range,
                           LabelPass::Append append, Progress& progress);

}  // namespace isobrick
