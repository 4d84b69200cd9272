#include <isobrick/pieces.h>

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "core/cancellable_progress.h"
#include "pipeline/pieces/merge_limit.h"
#include "pipeline/pieces/open_tiles.h"
#include "pipeline/pieces/piece_reader.h"
#include "pipeline/program_memory.h"
#include "surface/chunk_writer.h"
#include "surface/surface_extractor.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// Larger chunks of a mesh gain nothing.
constexpr std::uint64_t kMergeChunk = std::uint64_t{4} << 20;

/// Pieces of one mesh, in the order of their parts.
struct PieceSet {
  std::vector<fs::path> paths;
  std::vector<std::string> texts;  ///< their headers
  PieceDescription first;
  PiecesInfo info;
  std::uint64_t largest_tile = 0;
};

/// "parts 2, 5 and 7", of those that `has` is false for.
std::string missing_text(const std::vector<bool>& has) {
  constexpr std::size_t shown = 8;
  std::vector<std::size_t> missing;
  for (std::size_t i = 0; i < has.size(); ++i)
    if (!has[i]) missing.push_back(i + 1);
  std::string text = fmt::format("{}", missing.front());
  for (std::size_t i = 1; i < std::min(missing.size(), shown); ++i)
    text += fmt::format("{}{}", i + 1 == missing.size() ? " and " : ", ", missing[i]);
  if (missing.size() > shown) text += fmt::format(" and {} more", missing.size() - shown);
  return fmt::format("{} {}", missing.size() == 1 ? "part" : "parts", text);
}

/// Of a piece what is needed to put all in order.
struct FoundPiece {
  std::uint32_t number = 0;
  std::size_t argument = 0;
  TileRange tiles;
  std::string text;
};

class PieceCollector {
 public:
  explicit PieceCollector(std::span<const fs::path> paths) : paths_(paths) {
    if (paths.empty()) throw UsageError("there are no pieces to merge");
    for (std::size_t i = 0; i < paths.size(); ++i) add(i);
  }

  PieceSet collected() {
    std::sort(found_.begin(), found_.end(),
              [](const FoundPiece& a, const FoundPiece& b) { return a.number < b.number; });
    check_parts();
    for (FoundPiece& piece : found_) {
      set_.paths.push_back(paths_[piece.argument]);
      set_.texts.push_back(std::move(piece.text));
    }
    set_.info.header = set_.first.of_mesh;
    set_.info.isovalue = set_.first.isovalue();
    return std::move(set_);
  }

 private:
  void add(std::size_t argument) {
    const PieceReader reader(paths_[argument]);
    const PieceDescription& header = reader.header();
    if (found_.empty()) set_.first = header;
    check_same(header, argument);
    found_.push_back({header.part.number, argument, header.tiles, reader.header_text()});
    const PieceEnd& end = reader.end();
    set_.info.size.vertices += end.vertices;
    set_.info.size.triangles += end.triangles;
    set_.info.degenerate += end.degenerate;
    set_.info.bytes += end.bytes;
    set_.largest_tile = std::max(set_.largest_tile, end.largest_tile);
  }

  void check_same(const PieceDescription& header, std::size_t argument) const {
    std::string other = difference(set_.first.mesh, header.mesh);
    if (other.empty() && header.part.count != set_.first.part.count)
      other = fmt::format("number of parts ({} and {})", set_.first.part.count, header.part.count);
    if (!other.empty())
      throw UsageError(
          fmt::format("'{}' and '{}' are pieces of different meshes: they differ in {}",
                      paths_.front().string(), paths_[argument].string(), other));
  }

  void check_parts() const {
    std::vector<bool> has(set_.first.part.count);
    for (std::size_t i = 0; i < found_.size(); ++i) {
      if (i > 0 && found_[i].number == found_[i - 1].number)
        throw UsageError(fmt::format("'{}' and '{}' are both part {}: leave one of them out",
                                     paths_[found_[i - 1].argument].string(),
                                     paths_[found_[i].argument].string(),
                                     part_text({found_[i].number, set_.first.part.count})));
      has[found_[i].number - 1] = true;
    }
    if (found_.size() < has.size())
      throw UsageError(fmt::format("{} of {} {} missing", missing_text(has), has.size(),
                                   found_.size() + 1 == has.size() ? "is" : "are"));
    for (std::size_t i = 1; i < found_.size(); ++i)
      if (found_[i].tiles.begin != found_[i - 1].tiles.end)
        throw UsageError(fmt::format("'{}' does not go on where '{}' ends: make both again",
                                     paths_[found_[i].argument].string(),
                                     paths_[found_[i - 1].argument].string()));
  }

  std::span<const fs::path> paths_;
  std::vector<FoundPiece> found_;
  PieceSet set_;
};

PieceSet collect(std::span<const fs::path> paths) {
  PieceSet set = PieceCollector(paths).collected();
  std::uint64_t names = 0;
  for (std::size_t i = 0; i < set.paths.size(); ++i)
    names += 2 * (set.paths[i].native().size() + set.texts[i].size() + sizeof(FoundPiece));
  set.info.merge_memory = kProgramBytes + names + PieceReader::kBuffer +
                          (set.paths.size() > 1 ? OpenTiles::bytes(set.first.extent()) : 0) +
                          2 * set.largest_tile;
  return set;
}

/// Puts the pieces together, one after the other.
class Merger {
 public:
  /// `header` is what the sink was told.
  Merger(const PieceSet& set, MeshSink& sink, const MeshHeader& header, std::uint64_t chunk_bytes)
      : set_(set),
        piece_normals_(set.first.of_mesh.has_normals),
        normals_(header.has_normals),
        wide_(header.wide),
        chunk_bytes_(chunk_bytes),
        open_(set.first.extent()),
        sink_(sink) {
    if (!wide_) writer_.emplace(sink);
  }

  void append(std::size_t number, Progress& progress) {
    PieceReader reader(set_.paths[number]);
    if (reader.header_text() != set_.texts[number]) reader.fail("has changed meanwhile");
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
std::uint64_t plan_chunk(const PieceSet& set, bool wide, std::uint64_t sink_bytes,
                         const MergeOptions& options) {
  const std::uint64_t least = set.info.merge_memory + sink_bytes + (wide ? set.largest_tile : 0);
  if (options.memory < least)
    throw UsageError(fmt::format(
        "a memory budget of {:.1f} MiB is too small: at least --memory {}M is needed, {:.1f} MiB "
        "of it for the program and its libraries and {:.1f} for the output",
        in_mib(options.memory), mib_above(least), in_mib(kProgramBytes), in_mib(sink_bytes)));
  const std::uint64_t spare = (options.memory - least) / 2;
  return (wide ? 2 : 1) * set.largest_tile + std::min(spare, kMergeChunk);
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
  PieceSet set = collect(pieces);
  MeshHeader& header = set.info.header;
  header.has_normals = header.has_normals && options.normals;
  header.wide = set.info.size.vertices > max_narrow_vertices;
  if (header.wide && !sink.takes_wide())
    throw Error(fmt::format(
        "the mesh has more than {} vertices, which this output cannot number: choose PVTP, VTP, "
        "OBJ or GLB without filters, regions (--roi) or a coarser --level",
        max_narrow_vertices));
  const std::uint64_t chunk_bytes = plan_chunk(set, header.wide, sink.memory(), options);
  CancellableProgress cancellable(progress, options.cancel);
  cancellable.begin("merging", set.info.bytes);
  sink.begin(header);
  {
    Merger merger(set, sink, header, chunk_bytes);
    for (std::size_t i = 0; i < set.paths.size(); ++i) merger.append(i, cancellable);
    merger.finish();
  }
  sink.finish();
  cancellable.end();
  return set.info;
}

}  // namespace isobrick
