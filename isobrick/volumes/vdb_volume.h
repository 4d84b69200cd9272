#pragma once

#include <memory>
#include <string>

#include "isobrick/volumes/volume_request.h"

namespace isobrick {

/// Opens a grid of an OpenVDB file: the one that `said.grid` names, or the only
/// one that can be a volume. The grid is held in memory in OpenVDB's own sparse
/// form, never dense. Sample (0, 0, 0) is the lowest corner of the box of active
/// voxels, or of `said.region`.
std::unique_ptr<VolumeSource> open_vdb(const std::string& file, const VolumeRequest& said);

}  // namespace isobrick
