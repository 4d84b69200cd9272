#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

#include <isobrick/store_reader.h>

namespace isobrick::inline v0 {

/// Receives a brick that cannot be read, and why; called from any thread.
using BrickFailure = std::function<void(Int3 brick, const std::string& what)>;
/// Receives a brick's checksum, kAbsentBrick for an absent one; called from any thread.
using BrickChecksum = std::function<void(Int3 brick, std::uint32_t checksum)>;

/// Bytes that read_slab() takes on so many threads, and the reader for its shard indices.
std::uint64_t slab_memory(const StoreInfo& store, int level, int threads);

/// Decodes the samples of `box` of a level into `out`, dense in C order, on all
/// threads of the current arena. Without `failure` the first brick that cannot
/// be read ends it; otherwise such a brick's samples are left as they are. With `checksum` bricks
/// are read as they are now, though they may not be those that the store has checksums of.
void read_slab(const StoreReader& store, int level, Box3 box, std::byte* out,
               const BrickFailure& failure = nullptr, const BrickChecksum& checksum = nullptr);

}  // namespace isobrick
