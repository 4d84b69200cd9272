#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <isobrick/image_metadata.h>
#include <isobrick/selection.h>
#include "bricks/zarr/array_metadata.h"

namespace isobrick::inline v0 {

/// Which volume of an image with channels and times is read.
struct VolumeChoice {
  std::vector<Index> place;  ///< on the axes before z, y, x
  std::string folder;        ///< of its ranges, a key; empty when the image has one volume
};

/// An axis along which an image has several volumes.
struct VolumeAxis {
  std::string name;
  Index count = 0;
  bool by_channel = false, by_time = false;  ///< which options choose on it; both: either does
};

/// Those axes, if the selection leaves open which volume is meant; else none.
std::vector<VolumeAxis> open_axes(const ImageMetadata& image, const ArrayMetadata& array,
                                  const Selection& selection);

/// Throws UsageError when there are several volumes and the selection does not
/// name one, or names one that is not there. `image_name` is for messages; `array` is that
/// of a level.
VolumeChoice choose_volume(const std::string& image_name, const ImageMetadata& image,
                           const ArrayMetadata& array, const Selection& selection);

/// Where a volume's samples are among those of others in chunks and shards.
struct VolumePlace {
  std::vector<Index> chunk;                       ///< first coordinates of its chunks
  std::uint64_t in_shard = 0, shard_volumes = 1;  ///< its bricks, in units of all bricks of one
  std::uint64_t in_chunk = 0, chunk_volumes = 1;  ///< its samples in a decoded brick
};

/// `where` names the array's file; Error when it lacks the place.
VolumePlace place_volume(const ArrayMetadata& array, const std::vector<Index>& place,
                         const std::string& where);

}  // namespace isobrick
