#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <isobrick/api.h>
#include <isobrick/selection.h>
#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// What an axis of an array in a file stands for.
enum class AxisRole : std::uint8_t { space, channel, time };

/// One axis of an array in a file.
struct ArrayAxis {
  Index size = 0;                   ///< entries along it
  AxisRole role = AxisRole::space;  ///< what it stands for
  /// Of an axis of space: 0, 1, 2 for x, y, z where the file names it. Nothing: the fastest of them
  /// is x, the slowest z.
  std::optional<int> direction = std::nullopt;
};

/// The volume that a selection leaves of an array of several dimensions.
struct ArrayView {
  Int3 extent;                               ///< samples along x, y, z
  Int3 stride;                               ///< samples from one to the next along x, y, z
  Index first = 0;                           ///< its first sample
  Index total = 0;                           ///< samples of the whole array
  std::array<std::size_t, 3> kept{0, 1, 2};  ///< which axes are x, y, z

  friend bool operator==(const ArrayView&, const ArrayView&) = default;
};

/// Selects a volume from an array whose fastest axis is the first of `axes`.
/// Exactly three are space. Throws UsageError, beginning with `path`, for sizes
/// that are not positive or overflow and for two axes of one direction. It throws one too where
/// a channel or a time must be chosen, and where the chosen one does not exist.
ISOBRICK_API ArrayView select_volume(const std::string& path, std::span<const ArrayAxis> axes,
                                     const Selection& selection);

/// Where a file leaves open which three of its axes (fastest first) are space:
/// those of size 1 are not, nor is the first when a channel is selected, nor the
/// last when a time is. False when that leaves other than three.
ISOBRICK_API bool guess_roles(std::vector<ArrayAxis>& axes, const Selection& selection);

/// What to do about guess_roles being false, for a message.
inline constexpr const char* kRolesHint =
    "--channel C takes the fastest axis for channels, --time T the slowest one for time";

}  // namespace isobrick
