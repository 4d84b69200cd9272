#pragma once

#include <memory>
#include <string>

#include <isobrick/volume_request.h>

namespace isobrick::inline v0 {

/// Opens a VTK image file (`.vti`): its array `array`, or its scalars where that
/// is empty.
std::unique_ptr<VolumeSource> open_vti(const std::string& path, const std::string& array,
                                       const VolumeRequest& request);

}  // namespace isobrick
