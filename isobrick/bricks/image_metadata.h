#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "isobrick/core/transform.h"

namespace isobrick {

/// The zarr.json of a store's root group: OME-Zarr 0.5's multiscales and what
/// is ours under `attributes.isobrick`.
struct ImageMetadata {
  struct Level {
    std::string path;  ///< of the array, relative to the root
    Transform transform;
    friend bool operator==(const Level&, const Level&) = default;
  };
  std::string name;
  std::vector<Level> levels;
  bool ours = true;  ///< has `attributes.isobrick`
  /// Nothing when the store doesn't say.
  std::optional<bool> may_have_nan;

  friend bool operator==(const ImageMetadata&, const ImageMetadata&) = default;
};

/// The version of `attributes.isobrick` that we write, and the only one we read.
inline constexpr int kStoreVersion = 1;

std::string to_json(const ImageMetadata& image);

/// Reads the root's zarr.json; `where` names the file. DamageError for what is
/// broken, Error for an unknown version or what is not supported.
ImageMetadata parse_image_metadata(std::string_view text, const std::string& where);

}  // namespace isobrick
