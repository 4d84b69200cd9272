#pragma once

#include <cstdint>

namespace isobrick::inline v0 {

/// Which samples are inside of a surface. Triangles and vertices lie in the same places, and
/// samples that equal the isovalue stay on the side of the larger ones.
enum class Inside : std::uint8_t {
  above,  ///< those of at least the isovalue
  below,  ///< those less than it, as in a level set
};

}  // namespace isobrick
