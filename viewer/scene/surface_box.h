#pragma once

#include <optional>
#include <span>

#include "stream/brick_source.h"
#include "viewer/scene/node_tree.h"

namespace isobrick::inline v0 {

/// The bounding box, in level-0 index space, of the surfaces of level 0 within `part`; nullopt if
/// there are none. `tree`: of the same source.
///
/// It is the box of the active blocks of 16³ cells, which exceeds the surfaces by less than a block
/// on each side. If it has few blocks, the samples give the box of the active cells. Only range
/// chunks that may enlarge the box are read, one at a time, so memory does not grow with the
/// surface. Throws what reading ranges throws; with damaged bricks the box of the blocks is
/// returned.
std::optional<IndexBox> surface_box(const BrickSource& source, const NodeTree& tree,
                                    std::span<const double> isovalues, const IndexBox& part);

}  // namespace isobrick
