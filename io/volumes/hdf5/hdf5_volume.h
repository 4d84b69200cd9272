#pragma once

#include <memory>
#include <string>

#include <isobrick/volume_request.h>

namespace isobrick::inline v0 {

/// Opens a dataset of an HDF5 file; `dataset` empty: the only one that can be a
/// volume.
std::unique_ptr<VolumeSource> open_hdf5(const std::string& file, const std::string& dataset,
                                        const VolumeRequest& request);

}  // namespace isobrick
