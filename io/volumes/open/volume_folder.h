#pragma once

#include <memory>
#include <string>

#include <isobrick/volume_request.h>

namespace isobrick::inline v0 {

/// Opens a folder that holds a stack of TIFF files, in the order of their names
/// (numbers in them count as numbers), or a DICOM series. Throws UsageError when
/// it holds neither, or both.
std::unique_ptr<VolumeSource> open_folder(const std::string& path, const VolumeRequest& request);

}  // namespace isobrick
