#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <isobrick/image_metadata.h>
#include "bricks/zarr/array_metadata.h"

namespace isobrick {

/// The content of the metadata files of an image, of any version of Zarr. The image is a store of
/// ours, an OME-Zarr 0.5 or 0.4 image, or one Zarr array. An array counts as an image of one level
/// with samples at 0, 1, 2, …
struct MetadataFiles {
  struct Level {
    std::filesystem::path folder, file;
    ArrayMetadata array;
  };
  ImageMetadata image;
  std::vector<Level> levels;
  std::filesystem::path root;  ///< the file that `image` was read from
  std::uint32_t crc32c = 0;    ///< metadata_checksum()
};

/// Throws Error when `path` is no such image or something is not supported,
/// DamageError when a file is broken or missing.
MetadataFiles read_metadata_files(const std::filesystem::path& path);

/// Whether a folder looks like Zarr of any version.
bool is_zarr(const std::filesystem::path& path);

}  // namespace isobrick
