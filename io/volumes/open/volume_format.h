#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace isobrick::inline v0 {

enum class VolumeFormat : std::uint8_t {
  raw,  ///< and whatever is not recognised
  nrrd,
  meta_image,
  nifti,
  vti,         ///< VTK's XML
  legacy_vtk,  ///< VTK's older format
  tiff,
  hdf5,
  dicom,
  vdb,      ///< OpenVDB
  nanovdb,  ///< recognised to be refused, and so is this:
  zip,      ///< may hold a store, which a store's reader opens
};

/// The format's name for people: "NRRD".
std::string_view name_of(VolumeFormat format);

/// The format of a file: by its first bytes, else by its extension. Throws Error
/// when it cannot be read, UsageError when it is no regular file.
VolumeFormat recognise_format(const std::string& path);

/// The format that goes by a path's extension, whatever the file holds.
VolumeFormat format_of_extension(const std::string& path);

/// A path and what it names within the file: "run.h5:/data/temperature".
struct VolumePath {
  std::string file;
  std::string inner;  ///< "data/temperature", or empty
};

/// Parts a path at its last ":/" unless a file has the whole name.
VolumePath split_volume_path(const std::string& path);

/// What a volume is called: "scan" of "data/scan.nii.gz", "series/", "scan.zarr.zip" and
/// "scan.nrrd:/array".
std::string volume_stem(const std::string& path);

}  // namespace isobrick
