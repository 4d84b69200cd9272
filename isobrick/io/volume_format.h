#pragma once

#include <cstdint>
#include <string>

namespace isobrick {

enum class VolumeFormat : std::uint8_t {
  raw,  ///< and whatever is not recognised
  nrrd,
  meta_image,
  nifti,
};

/// The format of a file: by its first bytes, else by its extension. Throws Error
/// when it cannot be read, UsageError when it is no regular file.
VolumeFormat recognise_format(const std::string& path);

}  // namespace isobrick
