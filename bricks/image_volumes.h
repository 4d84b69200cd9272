#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "bricks/zarr/volume_choice.h"

namespace isobrick::inline v0 {

/// The volumes of an image, and which of them is meant.
struct ImageVolumes {
  std::vector<VolumeAxis> axes;  ///< along which there are several; none: the image has one
  std::vector<std::string> channel_names;  ///< as the image calls them, or none
  Selection selection;                     ///< on every axis
};

/// Those of the image at `path`: where `selection` leaves an axis open, the first along it. Throws
/// what open_storage() and read_metadata_files() do.
ImageVolumes image_volumes(const std::filesystem::path& path, const Selection& selection = {});

/// What chooses along an axis: the selection's channel or its time.
std::optional<Index>& place_on(const VolumeAxis& axis, Selection& selection);
Index place_on(const VolumeAxis& axis, const Selection& selection);

/// "channel 1, time 0"; empty where there is only one volume.
std::string text_of(const ImageVolumes& volumes);

}  // namespace isobrick
