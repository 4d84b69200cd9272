#pragma once

#include <optional>
#include <span>

#include "stream/brick_source.h"
#include "viewer/scene/node_tree.h"

namespace isobrick {

/// The box, in level-0 index space, around the surfaces of level 0 within `part`; nothing where
/// there are none. `tree` is that of the source.
///
/// It is that of the blocks of 16³ cells that the isovalues cross, by their ranges, and so larger
/// than the surfaces by less than a block on each side. Where it has few blocks, of which that
/// would be much, it is that of the cells, by their samples. Block ranges are read only where they
/// may make it larger, a range chunk at a time: memory does not grow with the surface. Throws what
/// reading ranges throws; damaged bricks leave the box of the blocks.
std::optional<IndexBox> surface_box(const BrickSource& source, const NodeTree& tree,
                                    std::span<const double> isovalues, const IndexBox& part);

}  // namespace isobrick
