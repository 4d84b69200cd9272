#pragma once

#include <isobrick/export.h>
#include <isobrick/progress.h>
#include <isobrick/volume_source.h>
#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {

/// Writes the isosurface of `box` (samples of a level) to `file` as a level set: distances
/// from the triangles that extract() makes, negative inside.
/// `info` describes the box as a volume. Throws UsageError where the grid exceeds the
/// budget, of which half at most goes to the extraction; Error where the store has no ranges.
void export_level_set(const StoreReader& store, Box3 box, const VolumeInfo& info,
                      const ExportOptions& options, OutputFile& file, Progress& progress);

}  // namespace isobrick
