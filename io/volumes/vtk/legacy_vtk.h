#pragma once

#include <memory>
#include <string>

#include <isobrick/volume_request.h>

namespace isobrick::inline v0 {

/// Opens a legacy VTK file (`.vtk`) of STRUCTURED_POINTS: the first of its point
/// data, or cell data where it has no others, which must be SCALARS or a FIELD.
std::unique_ptr<VolumeSource> open_legacy_vtk(const std::string& path,
                                              const VolumeRequest& request);

}  // namespace isobrick
