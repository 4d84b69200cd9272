#pragma once

#include <memory>
#include <string>
#include <vector>

#include <isobrick/volume_request.h>

namespace isobrick::inline v0 {

// Formats that are read by a library which may have been missing when this was
// built; then each throws a UsageError about it. `name` is for messages.

std::unique_ptr<VolumeSource> open_vti_if_built(const std::string& file, const std::string& array,
                                                const VolumeRequest& request);
std::unique_ptr<VolumeSource> open_tiff_if_built(const std::string& name,
                                                 const std::vector<std::string>& files,
                                                 const VolumeRequest& request);
std::unique_ptr<VolumeSource> open_hdf5_if_built(const std::string& file,
                                                 const std::string& dataset,
                                                 const VolumeRequest& request);
std::unique_ptr<VolumeSource> open_vdb_if_built(const std::string& file,
                                                const VolumeRequest& request);
std::unique_ptr<VolumeSource> open_dicom_if_built(const std::string& name,
                                                  const std::vector<std::string>& files,
                                                  const VolumeRequest& request);

}  // namespace isobrick
