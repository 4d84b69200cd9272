#pragma once

#include "isobrick/core/progress.h"
#include "isobrick/io/output_file.h"
#include "isobrick/pipeline/export.h"
#include "isobrick/volumes/volume_source.h"

namespace isobrick {

/// Writes the isosurface of `box` (samples of a level) to `file` as a level set: distances
/// from the triangles that extract() makes, negative inside.
/// `info` describes the box as a volume. Throws UsageError where the grid exceeds the
/// budget, of which half at most goes to the extraction; Error where the store has no ranges.
void export_level_set(const StoreReader& store, Box3 box, const VolumeInfo& info,
                      const ExportOptions& options, OutputFile& file, Progress& progress);

}  // namespace isobrick
