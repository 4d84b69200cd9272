#include <isobrick/pieces.h>

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "core/cancellable_progress.h"
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
  Merger(const PieceSet& set, MeshSink& sink, bool normals, std::uint64_t chunk_bytes)
      : set_(set),
        piece_normals_(set.first.of_mesh.has_normals),
        normals_(normals),
        chunk_bytes_(chunk_bytes),
        open_(set.first.extent()),
        writer_(sink) {}

  void append(std::size_t number, Progress& progress) {
    PieceReader reader(set_.paths[number]);
    if (reader.header_text() != set_.texts[number]) reader.fail("has changed meanwhile");
    open_.begin_piece(reader.header().tiles, reader.neighbours());
    if (!open_.fits()) reader.fail("does not fit the pieces before it");
    first_vertex_ = vertices_;
    std::uint64_t reported = 0;
    for (PieceTile tile; reader.next(tile);) {
      const std::uint64_t bytes = content_bytes(tile, piece_normals_);
      if (chunk_size() > 0 && chunk_size() + bytes > chunk_bytes_) hand_on();
      append_tile(tile, reader);
      progress.advance(bytes);
      reported += bytes;
    }
    progress.advance(reader.end().bytes - std::min(reader.end().bytes, reported));
  }

  void finish() {
    hand_on();
    writer_.finish();
  }

 private:
  std::uint64_t chunk_size() const {
    return mesh_bytes({chunk_.positions.size(), chunk_.triangles.size()}, piece_normals_);
  }

  void append_tile(const PieceTile& tile, PieceReader& reader) {
    const std::size_t v = chunk_.positions.size(), t = chunk_.triangles.size();
    chunk_.positions.resize(v + tile.vertices);
    reader.read(std::span(chunk_.positions.data() + v, tile.vertices));
    if (piece_normals_) {
      chunk_.normals.resize(v + tile.vertices);
      reader.read(std::span(chunk_.normals.data() + v, tile.vertices));
    }
    chunk_.triangles.resize(t + tile.triangles);
    const std::span<Triangle> triangles(chunk_.triangles.data() + t, tile.triangles);
    reader.read(triangles);
    open_.add(tile, vertices_);
    vertices_ += tile.vertices;
    if (!open_.numbers().renumber(triangles, first_vertex_, vertices_ - first_vertex_))
      reader.fail("is damaged: a triangle names a vertex that is not there");
  }

  void hand_on() {
    if (chunk_size() == 0) return;
    if (!normals_) chunk_.normals.clear();
    writer_.write(chunk_, vertices_ - chunk_.positions.size());
  }

  const PieceSet& set_;
  bool piece_normals_, normals_;
  std::uint64_t chunk_bytes_;
  OpenTiles open_;
  Mesh chunk_;
  std::uint64_t vertices_ = 0, first_vertex_ = 0;  ///< so far, and of the pieces before
  ChunkWriter writer_;
};

std::uint64_t plan_chunk(const PieceSet& set, std::uint64_t sink_bytes,
                         const MergeOptions& options) {
  const std::uint64_t least = set.info.merge_memory + sink_bytes;
  if (options.memory < least)
    throw UsageError(fmt::format(
        "a memory budget of {:.1f} MiB is too small: at least --memory {}M is needed, {:.1f} MiB "
        "of it for the program and its libraries and {:.1f} for the output",
        in_mib(options.memory), mib_above(least), in_mib(kProgramBytes), in_mib(sink_bytes)));
  const std::uint64_t spare = (options.memory - least) / 2;
  return set.largest_tile + std::min(spare, kMergeChunk);
}

}  // namespace

PiecesInfo read_pieces(std::span<const fs::path> pieces) { return collect(pieces).info; }

PiecesInfo merge_pieces(std::span<const fs::path> pieces, MeshSink& sink,
                        const MergeOptions& options, Progress& progress) {
  if (sink.indexing() != Indexing::welded)
    throw UsageError("pieces make a welded mesh: put a MeshFilter before a sink of another");
  PieceSet set = collect(pieces);
  if (set.info.size.vertices > std::numeric_limits<std::uint32_t>::max())
    throw Error(
        "the mesh has more than 4294967295 vertices, which an indexed mesh of 32 bits cannot "
        "number; extract regions (--roi) or a coarser --level");
  const std::uint64_t chunk_bytes = plan_chunk(set, sink.memory(), options);
  CancellableProgress cancellable(progress, options.cancel);
  set.info.header.has_normals = set.info.header.has_normals && options.normals;
  cancellable.begin("merging", set.info.bytes);
  sink.begin(set.info.header);
  {
    Merger merger(set, sink, set.info.header.has_normals, chunk_bytes);
    for (std::size_t i = 0; i < set.paths.size(); ++i) merger.append(i, cancellable);
    merger.finish();
  }
  sink.finish();
  cancellable.end();
  return set.info;
}

}  // namespace isobrick
