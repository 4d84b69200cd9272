#include <isobrick/array_view.h>

#include <fmt/format.h>

#include <limits>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

constexpr Index kMaxSamples = std::numeric_limits<Index>::max() / 8;

/// The size of the only axis of a role that has more than one entry, else 1.
Index count_of(const std::string& path, std::span<const ArrayAxis> axes, AxisRole role,
               const char* option) {
  Index count = 1;
  for (const ArrayAxis& axis : axes) {
    if (axis.role != role || axis.size == 1) continue;
    if (count > 1)
      throw UsageError(
          fmt::format("'{}': several of its axes would be for {}, which is not "
                      "supported",
                      path, option));
    count = axis.size;
  }
  return count;
}

void check_sizes(const std::string& path, std::span<const ArrayAxis> axes) {
  Index total = 1;
  std::string sizes;
  for (const ArrayAxis& axis : axes)
    sizes += fmt::format("{}{}", sizes.empty() ? "" : "x", axis.size);
  for (const ArrayAxis& axis : axes) {
    if (axis.size <= 0)
      throw UsageError(fmt::format("'{}': the extent {} is not positive", path, sizes));
    if (axis.size > kMaxSamples / total)
      throw UsageError(
          fmt::format("'{}': an array of {} samples is too large to address", path, sizes));
    total *= axis.size;
  }
}

}  // namespace

bool guess_roles(std::vector<ArrayAxis>& axes, const Selection& selection) {
  for (ArrayAxis& axis : axes) axis.role = AxisRole::space;
  std::size_t left = axes.size();
  for (ArrayAxis& axis : axes) {
    if (left == 3 || axis.size != 1) continue;
    axis.role = AxisRole::channel;
    --left;
  }
  if (left > 3 && selection.channel && axes.front().role == AxisRole::space) {
    axes.front().role = AxisRole::channel;
    --left;
  }
  if (left > 3 && selection.time && axes.back().role == AxisRole::space) {
    axes.back().role = AxisRole::time;
    --left;
  }
  return left == 3;
}

ArrayView select_volume(const std::string& path, std::span<const ArrayAxis> axes,
                        const Selection& selection) {
  check_sizes(path, axes);
  const Index channel = choose(
      path, "--channel", count_of(path, axes, AxisRole::channel, "--channel"), selection.channel);
  const Index time =
      choose(path, "--time", count_of(path, axes, AxisRole::time, "--time"), selection.time);
  ArrayView view;
  view.total = 1;
  int next = 0;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const ArrayAxis& axis = axes[i];
    if (axis.role == AxisRole::space) {
      if (next == 3)
        throw UsageError(fmt::format("'{}' has more than 3 dimensions of space", path));
      const int to = axis.direction.value_or(next);
      if (view.extent[to] != 0)
        throw UsageError(fmt::format("'{}': two of its axes are called {}", path, "xyz"[to]));
      view.extent[to] = axis.size;
      view.stride[to] = view.total;
      view.kept[static_cast<std::size_t>(to)] = i;
      ++next;
    } else if (axis.size > 1) {
      view.first += view.total * (axis.role == AxisRole::channel ? channel : time);
    }
    view.total *= axis.size;
  }
  if (next < 3) throw UsageError(fmt::format("'{}' has only {} dimensions of space", path, next));
  return view;
}

}  // namespace isobrick
