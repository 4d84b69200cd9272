#include "bricks/image_volumes.h"

#include <fmt/format.h>

#include <isobrick/storage.h>
#include "bricks/zarr/metadata_files.h"

namespace isobrick::inline v0 {

std::optional<Index>& place_on(const VolumeAxis& axis, Selection& selection) {
  // An axis without a role takes what was given.
  const bool by_channel = axis.by_channel && !(axis.by_time && selection.time);
  return by_channel ? selection.channel : selection.time;
}

Index place_on(const VolumeAxis& axis, const Selection& selection) {
  Selection copy = selection;
  return place_on(axis, copy).value_or(0);
}

ImageVolumes image_volumes(const std::filesystem::path& path, const Selection& selection) {
  const MetadataFiles files = read_metadata_files(*open_storage(path));
  ImageVolumes volumes{.axes = open_axes(files.image, files.levels.front().array, {}),
                       .channel_names = files.image.channel_names,
                       .selection = selection};
  for (const VolumeAxis& axis : volumes.axes) {
    std::optional<Index>& place = place_on(axis, volumes.selection);
    if (!place) place = 0;
  }
  return volumes;
}

std::string text_of(const ImageVolumes& volumes) {
  std::string text;
  for (const VolumeAxis& axis : volumes.axes) {
    Selection chosen = volumes.selection;
    const bool by_channel = &place_on(axis, chosen) == &chosen.channel;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", by_channel ? "channel" : "time",
                        place_on(axis, volumes.selection));
  }
  return text;
}

}  // namespace isobrick
