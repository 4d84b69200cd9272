#pragma once

#include <memory>
#include <string>
#include <vector>

#include <isobrick/volume_request.h>

namespace isobrick::inline v0 {

/// Opens the pages of TIFF files, one file after the other, as the planes of a
/// volume. `name` is what they are called together.
std::unique_ptr<VolumeSource> open_tiff(const std::string& name,
                                        const std::vector<std::string>& files,
                                        const VolumeRequest& request);

}  // namespace isobrick
