#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <stop_token>

#include <isobrick/api.h>
#include <isobrick/extract.h>
#include <isobrick/mesh.h>
#include <isobrick/part.h>
#include <isobrick/progress.h>
#include <isobrick/store_reader.h>

// A surface that many tasks make: each a piece, a file of its own, which needs none of the others.
// merge_pieces() puts them together to the mesh that extract() makes, byte for byte.

namespace isobrick::inline v0 {

/// What became of a piece.
struct PieceReport {
  ExtractReport surface;    ///< of the piece; of one that was there only the sizes
  bool is_kept = false;     ///< it was there, whole and of the same mesh
  std::uint64_t bytes = 0;  ///< of its file
};

/// Makes a part of a surface and writes it to the piece `path`, which has its name once it is
/// whole. The parts have about as many active blocks each; a part may be empty.
///
/// A piece of the same part that is whole is kept: its checksum is compared. A piece that is
/// damaged or another one is replaced; UsageError where `path` is any other file and `force` is not
/// set. Throws as extract() does, and UsageError for a part that there is not.
ISOBRICK_API PieceReport extract_piece(const StoreReader& store, const ExtractOptions& options,
                                       Part part, const std::filesystem::path& path,
                                       bool force = false, Progress& progress = no_progress());

/// What pieces will become, from their beginnings and ends.
struct PiecesInfo {
  MeshHeader header;               ///< of the mesh
  MeshSize size;                   ///< of the mesh
  double isovalue = 0;             ///< of the surface
  std::uint64_t degenerate = 0;    ///< triangles left out, with ExtractOptions::drop_degenerate
  std::uint64_t bytes = 0;         ///< of all pieces
  std::uint64_t merge_memory = 0;  ///< the least MergeOptions::memory, for a sink that holds none
};

/// Checks that `pieces` are all parts of one mesh, each once, in any order. Throws UsageError
/// naming what is missing, twice or not of the mesh, DamageError for a piece that shows damage.
ISOBRICK_API PiecesInfo read_pieces(std::span<const std::filesystem::path> pieces);

/// How pieces are put together.
struct MergeOptions {
  bool normals = true;                            ///< false: without those that the pieces have
  std::uint64_t memory = std::uint64_t{1} << 30;  ///< hard budget, bytes, with the sink
  /// Ends the operation with Cancelled, soon after a stop is requested on any thread.
  std::stop_token cancel = {};
};

/// Puts the pieces together to the mesh that extract() of their options makes, and streams it into
/// a sink of welded meshes (begin … finish). Throws as read_pieces() does, and DamageError for a
/// piece that turns out damaged. Throws UsageError for a budget that is too small and a sink of
/// another indexing. Throws Error for more vertices than 32 bits number where the sink does not
/// take them (MeshSink::takes_wide). The sink is not finished then.
ISOBRICK_API PiecesInfo merge_pieces(std::span<const std::filesystem::path> pieces, MeshSink& sink,
                                     const MergeOptions& options = {},
                                     Progress& progress = no_progress());

}  // namespace isobrick
