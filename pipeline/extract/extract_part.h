#pragma once

#include "pipeline/extract/extract_plan.h"

namespace isobrick::inline v0 {

/// Streams the mesh of a part into `sink`, as extract() does with all of it. Vertices of tiles
/// before the part have the first numbers, and the sink does not get them.
ExtractReport extract_part(const StoreReader& store, const ExtractOptions& options,
                           const RequestedPart& part, MeshSink& sink,
                           Progress& progress = no_progress());

}  // namespace isobrick
