#include "bricks/zarr/volume_choice.h"

#include <fmt/format.h>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

using Role = ImageMetadata::Axis::Role;

/// Roles that no axis of the image states. A selection by such a role gives it to an axis without
/// one.
struct FreeRoles {
  bool time = true, channel = true;

  explicit FreeRoles(const ImageMetadata& image) {
    for (const ImageMetadata::Axis& axis : image.leading) {
      time = time && axis.role != Role::time;
      channel = channel && axis.role != Role::channel;
    }
  }

  Role chosen(const Selection& selection) const {
    const bool by_time = time && selection.time, by_channel = channel && selection.channel;
    if (by_time == by_channel) return Role::unknown;
    return by_time ? Role::time : Role::channel;
  }
};

/// There are at most two such axes, so that at least one role is free for an axis without.
[[noreturn]] void refuse_axis(const std::string& path, const std::string& axis, Index count,
                              const FreeRoles& free) {
  throw UsageError(fmt::format("'{}' has {} volumes along axis '{}': choose one with {} 0 … {}{}",
                               path, count, axis, free.channel ? "--channel" : "--time", count - 1,
                               free.channel && free.time ? " or --time" : ""));
}

/// The place on one axis of a role, or of none and one place.
Index choose_on_axis(const std::string& path, Index count, Role role, const Selection& selection) {
  if (role == Role::time) return choose(path, "--time", count, selection.time);
  if (role == Role::channel) return choose(path, "--channel", count, selection.channel);
  return 0;
}

}  // namespace

std::vector<VolumeAxis> open_axes(const ImageMetadata& image, const ArrayMetadata& array,
                                  const Selection& selection) {
  std::vector<VolumeAxis> axes;
  const FreeRoles free(image);
  for (std::size_t i = 0; i < image.leading.size() && i < array.shape.size(); ++i) {
    const ImageMetadata::Axis& axis = image.leading[i];
    const bool unknown = axis.role == Role::unknown;
    if (array.shape[i] > 1)
      axes.push_back({axis.name, array.shape[i],
                      axis.role == Role::channel || (unknown && free.channel),
                      axis.role == Role::time || (unknown && free.time)});
  }
  const std::size_t chosen = (selection.channel ? 1U : 0U) + (selection.time ? 1U : 0U);
  return chosen < axes.size() ? axes : std::vector<VolumeAxis>();
}

VolumeChoice choose_volume(const std::string& image_name, const ImageMetadata& image,
                           const ArrayMetadata& array, const Selection& selection) {
  if (array.shape.size() != image.leading.size() + 3)
    throw Error(fmt::format("'{}': arrays of {} dimensions do not fit axes of {}", image_name,
                            array.shape.size(), image.leading.size() + 3));
  VolumeChoice choice;
  std::string name;
  const FreeRoles free(image);
  bool times = false, channels = false;
  for (std::size_t i = 0; i < image.leading.size(); ++i) {
    const ImageMetadata::Axis& axis = image.leading[i];
    const Index count = array.shape[i];
    Role role = axis.role;
    if (role == Role::unknown && count > 1) {
      role = free.chosen(selection);
      if (role == Role::unknown) refuse_axis(image_name, axis.name, count, free);
    }
    if ((role == Role::time && times) || (role == Role::channel && channels))
      throw Error(fmt::format("'{}' has several axes of {}, which is not supported", image_name,
                              role == Role::time ? "time" : "channels"));
    times |= role == Role::time;
    channels |= role == Role::channel;
    choice.place.push_back(choose_on_axis(image_name, count, role, selection));
    if (count > 1)
      name += fmt::format("{}{}_{}", name.empty() ? "" : "_",
                          role == Role::time ? "time" : "channel", choice.place.back());
  }
  if (!times) choose(image_name, "--time", 1, selection.time);
  if (!channels) choose(image_name, "--channel", 1, selection.channel);
  if (!name.empty()) choice.folder = "isobrick/" + name;
  return choice;
}

VolumePlace place_volume(const ArrayMetadata& array, const std::vector<Index>& place,
                         const std::string& where) {
  if (array.shape.size() != place.size() + 3)
    throw Error(fmt::format("{}: arrays of {} dimensions are not supported here, only of {}", where,
                            array.shape.size(), place.size() + 3));
  VolumePlace result;
  for (std::size_t i = 0; i < place.size(); ++i) {
    if (place[i] >= array.shape[i])
      throw Error(fmt::format("{}: the level lacks number {} of axis {}", where, place[i], i));
    const Index chunk = array.chunk[i], brick = array.brick()[i];
    const auto bricks = static_cast<std::uint64_t>(chunk / brick);
    result.chunk.push_back(place[i] / chunk);
    result.in_shard =
        result.in_shard * bricks + static_cast<std::uint64_t>(place[i] % chunk / brick);
    result.shard_volumes *= bricks;
    result.in_chunk = result.in_chunk * static_cast<std::uint64_t>(brick) +
                      static_cast<std::uint64_t>(place[i] % brick);
    result.chunk_volumes *= static_cast<std::uint64_t>(brick);
  }
  return result;
}

}  // namespace isobrick
