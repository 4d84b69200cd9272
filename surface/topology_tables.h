#pragma once

#include "surface/cell_topology.h"

namespace isobrick::inline v0 {

/// The tables that extractions with Topology::trilinear use, made at the first call.
const TopologyTables& topology_tables();

}  // namespace isobrick
