#pragma once

#include <array>
#include <cstddef>

#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// The default colour of a surface, sRGB in [0, 1]; colours of the first surfaces are distinct.
inline Vec3f surface_colour(std::size_t number) {
  static constexpr std::array<Vec3f, 6> kColours{{{0.87f, 0.80f, 0.70f},
                                                  {0.35f, 0.60f, 0.85f},
                                                  {0.85f, 0.42f, 0.34f},
                                                  {0.48f, 0.72f, 0.42f},
                                                  {0.72f, 0.52f, 0.80f},
                                                  {0.92f, 0.72f, 0.28f}}};
  return kColours[number % kColours.size()];
}

}  // namespace isobrick
