#pragma once

#include <memory>

#include <isobrick/volume_request.h>

namespace isobrick::inline v0 {

/// The samples of `source` that `roi`, `region` and `stride` of the request select, with `nodata`
/// as NaN; the source itself where the request selects all. A stream stays one. Takes a plane of
/// samples beside the source. Throws UsageError for a region that does not meet the volume.
std::unique_ptr<VolumeSource> select_samples(std::unique_ptr<VolumeSource> source,
                                             const VolumeRequest& request);

}  // namespace isobrick
