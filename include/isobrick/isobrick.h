#pragma once

// All of the library: open() and extract() first of all.

#include <isobrick/attributes.h>
#include <isobrick/convert.h>
#include <isobrick/device_extractor.h>
#include <isobrick/error.h>
#include <isobrick/estimate.h>
#include <isobrick/export.h>
#include <isobrick/extract.h>
#include <isobrick/histogram.h>
#include <isobrick/index_build.h>
#include <isobrick/isovalue.h>
#include <isobrick/label_index.h>
#include <isobrick/label_pieces.h>
#include <isobrick/labels.h>
#include <isobrick/mesh.h>
#include <isobrick/mesh_file_sink.h>
#include <isobrick/mesh_filters.h>
#include <isobrick/mesh_sinks.h>
#include <isobrick/open_source.h>
#include <isobrick/open_volume.h>
#include <isobrick/part.h>
#include <isobrick/pieces.h>
#include <isobrick/progress.h>
#include <isobrick/recode.h>
#include <isobrick/store_reader.h>
#include <isobrick/synth_source.h>
#include <isobrick/upload.h>
#include <isobrick/verify.h>
#include <isobrick/version.h>
#include <isobrick/volume.h>
#include <isobrick/volume_extractor.h>
#include <isobrick/volume_source.h>

namespace isobrick::inline v0 {

/// A surface of an opened volume in memory: extract() of its store.
inline Mesh extract(const OpenedVolume& volume, const ExtractOptions& options,
                    Progress& progress = no_progress()) {
  return extract(volume.store(), options, progress);
}

}  // namespace isobrick
