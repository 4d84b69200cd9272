#pragma once

#include <cmath>
#include <optional>

#include <isobrick/inside.h>
#include <isobrick/store_reader.h>

namespace isobrick::inline v0 {

/// Whether the samples are signed distances, negative inside.
inline bool is_level_set(const StoreInfo& info) { return info.grid_class == "level set"; }

/// The inside where the user gives none.
inline Inside inside_of(const StoreInfo& info) {
  return is_level_set(info) ? Inside::below : Inside::above;
}

/// The distance from the surface up to which a level set has samples of its own; nothing for other
/// volumes.
inline std::optional<double> narrow_band(const StoreInfo& info) {
  if (!is_level_set(info) || !(std::abs(info.fill_value) > 0)) return std::nullopt;
  return std::abs(info.fill_value);
}

}  // namespace isobrick
