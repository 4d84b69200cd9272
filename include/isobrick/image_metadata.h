#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <isobrick/api.h>
#include <isobrick/label_properties.h>
#include <isobrick/transform.h>

namespace isobrick::inline v0 {

/// What a store is written as: OME-Zarr 0.5 is Zarr version 3, 0.4 is version 2 and has no
/// shards, so that each brick is a file.
enum class OmeVersion : std::uint8_t { v04, v05 };

/// The range of the samples, and which part of it viewers show at first.
struct DisplayWindow {
  double min = 0;    ///< the smallest sample
  double max = 0;    ///< the largest sample
  double start = 0;  ///< shown black
  double end = 0;    ///< shown white
  friend bool operator==(const DisplayWindow&, const DisplayWindow&) = default;
};

/// The zarr.json of a root group: OME-Zarr's multiscales, of 0.5 in ours, and what
/// is ours under `attributes.isobrick`.
struct ImageMetadata {
  /// A resolution.
  struct Level {
    std::string path;     ///< of the array, relative to the root
    Transform transform;  ///< index space of the level to world space
    friend bool operator==(const Level&, const Level&) = default;
  };
  /// An axis before z, y, x.
  struct Axis {
    /// What such an axis stands for.
    enum class Role : std::uint8_t { time, channel, unknown };
    std::string name;           ///< as the image has it
    Role role = Role::unknown;  ///< what it stands for
    friend bool operator==(const Axis&, const Axis&) = default;
  };
  std::string name;                        ///< of the image, or empty
  std::vector<Axis> leading;               ///< none in ours
  std::vector<std::string> channel_names;  ///< as `omero` calls them; empty where it does not
  std::vector<Level> levels;               ///< the finest first
  bool ours = true;                        ///< has `attributes.isobrick`
  /// nullopt when the store doesn't state it.
  std::optional<bool> may_have_nan;
  std::string grid_class;               ///< as OpenVDB calls it ("level set"), or empty
  std::string grid_name;                ///< of the OpenVDB grid, or empty
  std::optional<LabelTable> labels;     ///< of a label image: `image-label`
  std::string downsampling;             ///< how coarser levels were made ("mean"): `type`; or empty
  std::optional<DisplayWindow> window;  ///< `omero`, which is written and never read
  /// The metadata_checksum() that the root states.
  std::optional<std::uint32_t> checksum;

  friend bool operator==(const ImageMetadata&, const ImageMetadata&) = default;
};

/// The version of `attributes.isobrick` that we write, and the only one we read.
inline constexpr int kStoreVersion = 3;

/// The zarr.json of the root group.
ISOBRICK_API std::string to_json(const ImageMetadata& image);

/// Reads the root's zarr.json; `where` names the file. DamageError for what is
/// broken, Error for an unknown version or what is not supported.
ISOBRICK_API ImageMetadata parse_image_metadata(std::string_view text, const std::string& where);

/// CRC-32C over the values that the root's zarr.json and those of its levels
/// hold, in the order of the levels; docs/reference/store_format.md defines over which and
/// how. The root's own checksum does not enter it, nor does how the JSON is laid
/// out. Images of others, without `attributes.isobrick`, have one, too.
/// `where` names the root's file.
ISOBRICK_API std::uint32_t metadata_checksum(std::string_view root,
                                             std::span<const std::string> levels,
                                             const std::string& where);

}  // namespace isobrick
