#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <isobrick/volume_request.h>
#include "io/volumes/vdb/vdb_level_set.h"
#include "io/volumes/vdb/vdb_writer.h"

namespace isobrick::inline v0 {

// What the modules of formats return (io/bytes/module.h).

/// lib/isobrick/isobrick_hdf5.so
struct Hdf5Module {
  const char* version;
  std::unique_ptr<VolumeSource> (*open)(const std::string& file, const std::string& dataset,
                                        const VolumeRequest& request);
};

/// lib/isobrick/isobrick_dicom.so
struct DicomModule {
  const char* version;
  std::unique_ptr<VolumeSource> (*open)(const std::string& name,
                                        const std::vector<std::string>& files,
                                        const VolumeRequest& request);
};

/// lib/isobrick/isobrick_openvdb.so
struct VdbModule {
  const char* version;
  std::unique_ptr<VolumeSource> (*open)(const std::string& file, const VolumeRequest& request);
  std::unique_ptr<VdbWriter> (*make_writer)(const VolumeInfo& info, const std::string& name,
                                            std::uint64_t budget);
  std::unique_ptr<VdbLevelSet> (*make_level_set)(const VolumeInfo& info, const std::string& name,
                                                 int half_band, int threads, std::uint64_t budget);
};

// Each is loaded once. They throw what load_module() does.
const Hdf5Module& hdf5_module();
const DicomModule& dicom_module();
const VdbModule& vdb_module();

}  // namespace isobrick
