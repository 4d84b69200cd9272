#pragma once

#include <cstdint>

namespace isobrick::inline v0 {

/// How a surface passes through cells whose corners allow several ways. Either way the mesh is
/// welded and closed, and vertices on lattice edges lie in the same places.
enum class Topology : std::uint8_t {
  consistent,  ///< by a rule that looks at sides only: the inside of a face stays connected
  trilinear,   ///< as the trilinear interpolant of the samples does it, tunnels included
};

}  // namespace isobrick
