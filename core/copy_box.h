#pragma once

#include <cstddef>
#include <cstring>

#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// Samples of a box, dense in C order [z, y, x].
template <class Byte>
struct BoxSamples {
  Byte* samples;
  Box3 box;

  Byte* at(Int3 p, std::size_t sample_bytes) const {
    return samples +
           static_cast<std::size_t>(linear_index(p - box.lo, box.extent())) * sample_bytes;
  }
};

/// Copies the samples of `part`, which lies in both boxes. The two may share their memory
/// where no row is written behind one that is still to be read.
inline void copy_box(BoxSamples<const std::byte> from, BoxSamples<std::byte> to, Box3 part,
                     std::size_t sample_bytes) {
  const auto row = static_cast<std::size_t>(part.extent().x) * sample_bytes;
  for (Index z = part.lo.z; z < part.hi.z; ++z)
    for (Index y = part.lo.y; y < part.hi.y; ++y) {
      const Int3 p{part.lo.x, y, z};
      std::memmove(to.at(p, sample_bytes), from.at(p, sample_bytes), row);
    }
}

}  // namespace isobrick
