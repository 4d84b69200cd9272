#pragma once

#include <memory>
#include <string>

#include <isobrick/volume_request.h>

namespace isobrick::inline v0 {

/// Opens a grid of an OpenVDB file: the one that `request.grid` names, or the only one that can be
/// a volume. The grid's tree and its leaves' masks are held in memory, in OpenVDB's own sparse
/// form. The values of leaves are read from the file when they are needed. Values of bool and mask
/// grids are held, too, and those of files whose layout only OpenVDB's own reader knows.
/// Sample (0, 0, 0) is the lowest corner of the box of active voxels, or of `request.bounds`.
std::unique_ptr<VolumeSource> open_vdb(const std::string& file, const VolumeRequest& request);

}  // namespace isobrick
