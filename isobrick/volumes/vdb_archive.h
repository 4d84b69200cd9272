#pragma once

#include <openvdb/Grid.h>

#include <string>
#include <vector>

#include "isobrick/volumes/vdb_header.h"

namespace isobrick {

/// Reads a whole grid; it is then independent of the file. Throws Error for
/// damaged files.
openvdb::GridBase::Ptr read_vdb_grid(const std::string& path, const std::vector<VdbGrid>& grids,
                                     const VdbGrid& chosen);

}  // namespace isobrick
