#pragma once

#include <optional>

#include "isobrick/gpu/device_volume_impl.h"
#include "isobrick/gpu/search_kernel.h"
#include "isobrick/gpu/span_indices.h"

namespace isobrick::gpu {

/// The structure of a search, if it has one.
std::optional<IndexKind> index_kind_of(TileSearch search);

/// What the kernel of the search goes by.
TileTest test_of(TileSearch search);

/// An index over all tiles of a volume, built on its stream. Ids are places in
/// Morton order, those of an octree places in C order [z, y, x].
SpanIndices index_tiles(const DeviceVolume::Impl& volume, IndexKind kind);

}  // namespace isobrick::gpu
