#include "tools/info_volumes.h"

#include <algorithm>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>

#include <isobrick/storage.h>
#include "bricks/zarr/metadata_files.h"
#include "bricks/zarr/volume_choice.h"
#include "core/printable.h"
#include "tools/format.h"
#include "tools/options.h"

namespace isobrick::tools {
namespace {

using nlohmann::ordered_json;

Int3 extent_of(const ArrayMetadata& array) {
  const std::size_t n = array.shape.size();
  return {array.shape[n - 1], array.shape[n - 2], array.shape[n - 3]};
}

/// Where all volumes of the axis are channels, and have names.
bool has_names(const VolumeAxis& axis, const ImageMetadata& image) {
  return axis.by_channel && !axis.by_time &&
         image.channel_names.size() == static_cast<std::size_t>(axis.count);
}

std::vector<std::string> options_of(const VolumeAxis& axis) {
  std::vector<std::string> options;
  if (axis.by_channel) options.emplace_back("--channel");
  if (axis.by_time) options.emplace_back("--time");
  return options;
}

/// Throws UsageError for a number that no axis has of those on which the option chooses.
void check_number(const std::string& path, const char* option, bool VolumeAxis::*by,
                  const std::vector<VolumeAxis>& axes, std::optional<Index> number) {
  Index count = 1;
  for (const VolumeAxis& axis : axes)
    if (axis.*by) count = std::max(count, axis.count);
  if (number) choose(path, option, count, number);
}

ordered_json json_of(const std::filesystem::path& path, const MetadataFiles& files,
                     const std::vector<VolumeAxis>& axes) {
  const Transform& transform = files.image.levels.front().transform;
  ordered_json object{{"command", "info"},
                      {"input", path.string()},
                      {"extent", to_json(extent_of(files.levels.front().array))},
                      {"type", zarr_name(files.levels.front().array.type)},
                      {"spacing", to_json(transform.spacing)},
                      {"origin", to_json(transform.origin)},
                      {"direction", transform.direction},
                      {"unit", transform.unit},
                      {"axes", ordered_json::array()},
                      {"levels", ordered_json::array()}};
  for (const VolumeAxis& axis : axes) {
    ordered_json item{{"name", axis.name}, {"count", axis.count}, {"options", options_of(axis)}};
    if (has_names(axis, files.image)) item["names"] = files.image.channel_names;
    object["axes"].push_back(std::move(item));
  }
  for (std::size_t i = 0; i < files.levels.size(); ++i)
    object["levels"].push_back({{"extent", to_json(extent_of(files.levels[i].array))},
                                {"spacing", to_json(files.image.levels[i].transform.spacing)}});
  object["peak_resident_bytes"] = peak_resident_bytes();
  return object;
}

std::string text_of(const std::filesystem::path& path, const MetadataFiles& files,
                    const std::vector<VolumeAxis>& axes) {
  const Transform& transform = files.image.levels.front().transform;
  const Vec3d spacing = transform.spacing;
  Index volumes = 1;
  for (const VolumeAxis& axis : axes) volumes *= axis.count;
  std::string text = fmt::format("image        {}\n", path.string());
  text += fmt::format("volumes      {}, each {} samples of {}\n", volumes,
                      human_extent(extent_of(files.levels.front().array)),
                      zarr_name(files.levels.front().array.type));
  text += fmt::format("spacing      {:g} x {:g} x {:g} {}\n", spacing.x, spacing.y, spacing.z,
                      transform.unit.empty() ? "(no unit)" : transform.unit);
  for (const VolumeAxis& axis : axes) {
    text += fmt::format("axis {:<7} {} volumes: {} 0 … {}\n", printable(axis.name, 40), axis.count,
                        fmt::join(options_of(axis), " or "), axis.count - 1);
    for (std::size_t i = 0; has_names(axis, files.image) && i < files.image.channel_names.size();
         ++i)
      text += fmt::format("  {:<10} {}\n", i, printable(files.image.channel_names[i], 80));
  }
  for (std::size_t i = 0; i < files.levels.size(); ++i)
    text += fmt::format("level {:<6} {}\n", i, human_extent(extent_of(files.levels[i].array)));
  return text;
}

}  // namespace

bool list_volumes(const std::filesystem::path& path, const Storage& storage,
                  const Selection& selection, Console& console) {
  const MetadataFiles files = read_metadata_files(storage);
  const std::vector<VolumeAxis> axes =
      open_axes(files.image, files.levels.front().array, selection);
  if (axes.empty()) return false;
  check_number(path.string(), "--channel", &VolumeAxis::by_channel, axes, selection.channel);
  check_number(path.string(), "--time", &VolumeAxis::by_time, axes, selection.time);
  console.result(json_of(path, files, axes), text_of(path, files, axes));
  return true;
}

}  // namespace isobrick::tools
