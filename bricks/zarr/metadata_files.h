#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <isobrick/image_metadata.h>
#include <isobrick/storage.h>
#include "bricks/zarr/array_metadata.h"

namespace isobrick::inline v0 {

/// The content of the metadata files of an image, of any version of Zarr. The image is a store of
/// ours, an OME-Zarr 0.5 or 0.4 image, or one Zarr array. An array counts as an image of one level
/// with samples at 0, 1, 2, …
struct MetadataFiles {
  struct Level {
    std::string folder, file;  ///< keys
    ArrayMetadata array;
  };
  ImageMetadata image;
  std::vector<Level> levels;
  std::string root;          ///< key of the object that `image` was read from
  std::uint32_t crc32c = 0;  ///< metadata_checksum()
};

/// Throws Error when `storage` has no such image or something is not supported,
/// DamageError when a file is broken or missing.
MetadataFiles read_metadata_files(const Storage& storage);

/// Whether a folder looks like Zarr of any version. A zip and a URL count, in which it may lie.
bool is_zarr(const std::filesystem::path& path);

}  // namespace isobrick
