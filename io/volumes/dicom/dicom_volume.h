#pragma once

#include <memory>
#include <string>
#include <vector>

#include <isobrick/volume_request.h>

namespace isobrick::inline v0 {

/// Opens the files of a DICOM series as the planes of a volume, sorted by where
/// they lie; or the frames of one file. `name` is what they are called together.
/// Throws UsageError for files that do not make one regular volume.
std::unique_ptr<VolumeSource> open_dicom(const std::string& name,
                                         const std::vector<std::string>& files,
                                         const VolumeRequest& request);

}  // namespace isobrick
