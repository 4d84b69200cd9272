#pragma once

#include <openvdb/openvdb.h>

namespace isobrick::inline v0 {

/// A grid of 16-bit floats, in memory too. OpenVDB writes them since version 13, and
/// calls the type HalfGrid; older versions can make it all the same.
using VdbHalfGrid = openvdb::Grid<openvdb::tree::Tree4<openvdb::math::half, 5, 4, 3>::Type>;

/// Lets OpenVDB make grids of this type by its name. Thread-safe.
inline void register_vdb_half_grid() {
  [[maybe_unused]] static const bool registered = [] {
    if (!VdbHalfGrid::isRegistered()) VdbHalfGrid::registerGrid();
    return true;
  }();
}

}  // namespace isobrick
