#pragma once

#include <cstdint>

#include <isobrick/pieces.h>

namespace isobrick::inline v0 {

/// What merge_pieces() does, for a test with another limit than kMaxNarrowVertices: a mesh of more
/// vertices has numbers of 64 bits.
PiecesInfo merge_pieces_within(std::uint64_t max_narrow_vertices,
                               std::span<const std::filesystem::path> pieces, MeshSink& sink,
                               const MergeOptions& options, Progress& progress);

}  // namespace isobrick
