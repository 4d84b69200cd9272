#include <isobrick/pieces.h>

#include <algorithm>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "core/cancellable_progress.h"
#include "pipeline/pieces/merge_limit.h"
#include "pipeline/pieces/open_tiles.h"
#include "pipeline/pieces/piece_reader.h"
#include "pipeline/pieces/piece_set.h"
#include "pipeline/program_memory.h"
#include "surface/chunk_writer.h"
#include "surface/surface_extractor.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// Larger chunks of a mesh gain nothing.
constexpr std::uint64_t kMergeChunk = std::uint64_t{4} << 20;

/// The pieces of a mesh, and what is known of it.
struct SurfacePieces {
  PieceSet set;
  PieceDescription first;
  PiecesInfo info;
};

SurfacePieces collect(std::span<const fs::path> paths) {
  SurfacePieces pieces;
  PieceCollector collector(paths);
  for (const fs::path& path : paths) {
    const PieceReader reader(path);
    collector.add(reader.header(), reader.end());
    if (&path == &paths.front()) pieces.first = reader.header();
    pieces.info.degenerate += reader.end().degenerate;
  }
  pieces.set = std::move(collector).collected();
  const PieceSet& set = pieces.set;
  pieces.info.header = pieces.first.of_mesh;
  pieces.info.isovalue = pieces.first.isovalue();
  pieces.info.size = {set.vertices, set.triangles};
  pieces.info.bytes = set.bytes;
  pieces.info.merge_memory = kProgramBytes + set.memory() + PieceReader::kBuffer +
                             (set.pieces.size() > 1 ? OpenTiles::bytes(pieces.first.extent()) : 0) +
                             2 * set.largest_tile;
  return pieces;
}

/// Puts the pieces together, one after the other.
class Merger {
 public:
  /// `header` is what the sink began with.
  Merger(const SurfacePieces& pieces, MeshSink& sink, const MeshHeader& header,
         std::uint64_t chunk_bytes)
      : set_(pieces.set),
        piece_normals_(pieces.first.of_mesh.has_normals),
        normals_(header.has_normals),
        wide_(header.wide),
        chunk_bytes_(chunk_bytes),
        open_(pieces.first.extent()),
        sink_(sink) {
    if (!wide_) writer_.emplace(sink);
  }

  void append(std::size_t number, Progress& progress) {
    PieceReader reader(set_.pieces[number].path);
    if (!set_.pieces[number].is_same(reader.end())) reader.fail("has changed meanwhile");
    open_.begin_piece(reader.header().tiles, reader.neighbours());
    if (!open_.fits()) reader.fail("does not fit the pieces before it");
    first_vertex_ = vertices_;
    std::uint64_t reported = 0;
    for (PieceTile tile; reader.next(tile);) {
      const std::uint64_t bytes = content_bytes(tile, piece_normals_);
      if (chunk_size() > 0 && chunk_size() + (wide_ ? 2 : 1) * bytes > chunk_bytes_) hand_on();
      append_tile(tile, reader);
      progress.advance(bytes);
      reported += bytes;
    }
    progress.advance(reader.end().bytes - std::min(reader.end().bytes, reported));
  }

  void finish() {
    hand_on();
    if (writer_) writer_->finish();
  }

 private:
  std::uint64_t chunk_size() const {
    return mesh_bytes({chunk_.positions.size(), chunk_.triangles.size()}, piece_normals_) +
           wide_triangles_.size() * sizeof(WideTriangle);
  }

  void append_tile(const PieceTile& tile, PieceReader& reader) {
    const std::size_t v = chunk_.positions.size();
    chunk_.positions.resize(v + tile.vertices);
    reader.read(std::span(chunk_.positions.data() + v, tile.vertices));
    if (piece_normals_) {
      chunk_.normals.resize(v + tile.vertices);
      reader.read(std::span(chunk_.normals.data() + v, tile.vertices));
    }
    open_.add(tile, vertices_);
    vertices_ += tile.vertices;
    if (!(wide_ ? append_wide(tile, reader) : append_narrow(tile, reader)))
      reader.fail("is damaged: a triangle names a vertex that is not there");
  }

  bool append_narrow(const PieceTile& tile, PieceReader& reader) {
    const std::size_t t = chunk_.triangles.size();
    chunk_.triangles.resize(t + tile.triangles);
    const std::span<Triangle> triangles(chunk_.triangles.data() + t, tile.triangles);
    reader.read(triangles);
    return open_.numbers().renumber(triangles, first_vertex_, vertices_ - first_vertex_);
  }

  bool append_wide(const PieceTile& tile, PieceReader& reader) {
    of_tile_.resize(tile.triangles);
    reader.read(std::span(of_tile_.data(), of_tile_.size()));
    const std::size_t t = wide_triangles_.size();
    wide_triangles_.resize(t + tile.triangles);
    return open_.numbers().renumber(of_tile_.span(), first_vertex_, vertices_ - first_vertex_,
                                    {wide_triangles_.data() + t, tile.triangles});
  }

  void hand_on() {
    if (chunk_size() == 0) return;
    if (!normals_) chunk_.normals.clear();
    const std::uint64_t first = vertices_ - chunk_.positions.size();
    if (writer_) return writer_->write(chunk_, first);
    MeshChunk chunk = chunk_.chunk(first);
    chunk.wide_triangles = wide_triangles_.span();
    sink_.write(chunk);
    chunk_.clear();
    wide_triangles_.clear();
  }

  const PieceSet& set_;
  bool piece_normals_, normals_, wide_;
  std::uint64_t chunk_bytes_;
  OpenTiles open_;
  Mesh chunk_;
  PodBuffer<Triangle> of_tile_;                    ///< with the numbers of its piece
  PodBuffer<WideTriangle> wide_triangles_;         ///< of the chunk
  std::uint64_t vertices_ = 0, first_vertex_ = 0;  ///< so far, and of the pieces before
  MeshSink& sink_;
  std::optional<ChunkWriter> writer_;  ///< of numbers of 32 bits
};

/// Bytes of a chunk. With numbers of 64 bits there is one chunk at a time, twice as large, and a
/// tile beside it.
std::uint64_t plan_chunk(const SurfacePieces& pieces, bool wide, std::uint64_t sink_bytes,
                         const MergeOptions& options) {
  const std::uint64_t tile = pieces.set.largest_tile;
  const std::uint64_t least = pieces.info.merge_memory + sink_bytes + (wide ? tile : 0);
  if (options.memory < least)
    throw UsageError(fmt::format(
        "a memory budget of {:.1f} MiB is too small: at least --memory {}M is needed, {:.1f} MiB "
        "of it for the program and its libraries and {:.1f} for the output",
        in_mib(options.memory), mib_above(least), in_mib(kProgramBytes), in_mib(sink_bytes)));
  const std::uint64_t spare = (options.memory - least) / 2;
  return (wide ? 2 : 1) * tile + std::min(spare, kMergeChunk);
}

}  // namespace

PiecesInfo read_pieces(std::span<const fs::path> pieces) { return collect(pieces).info; }

PiecesInfo merge_pieces(std::span<const fs::path> pieces, MeshSink& sink,
                        const MergeOptions& options, Progress& progress) {
  return merge_pieces_within(kMaxNarrowVertices, pieces, sink, options, progress);
}

PiecesInfo merge_pieces_within(std::uint64_t max_narrow_vertices, std::span<const fs::path> pieces,
                               MeshSink& sink, const MergeOptions& options, Progress& progress) {
  if (sink.indexing() != Indexing::welded)
    throw UsageError("pieces make a welded mesh: put a MeshFilter before a sink of another");
  SurfacePieces all = collect(pieces);
  MeshHeader& header = all.info.header;
  header.has_normals = header.has_normals && options.normals;
  header.wide = all.info.size.vertices > max_narrow_vertices;
  if (header.wide && !sink.takes_wide())
    throw Error(fmt::format(
        "the mesh has more than {} vertices, which this output cannot number: choose PVTP, VTP, "
        "OBJ, GLB or levels of detail, a filter that makes it smaller, regions (--roi) or a "
        "coarser --level",
        max_narrow_vertices));
  const std::uint64_t chunk_bytes = plan_chunk(all, header.wide, sink.memory(), options);
  CancellableProgress cancellable(progress, options.cancel);
  cancellable.begin("merging", all.info.bytes);
  sink.begin(header);
  {
    Merger merger(all, sink, header, chunk_bytes);
    for (std::size_t i = 0; i < all.set.pieces.size(); ++i) merger.append(i, cancellable);
    merger.finish();
  }
  sink.finish();
  cancellable.end();
  return all.info;
}

}  // namespace isobrick
