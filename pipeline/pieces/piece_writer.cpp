#include "pipeline/pieces/piece_writer.h"

#include <algorithm>
#include <utility>

#include <isobrick/error.h>
#include "bricks/zarr/codec.h"
#include "surface/boundary_map.h"

namespace isobrick::inline v0 {

PieceWriter::PieceWriter(FileWriter& out, const PieceDescription& header)
    : out_(out),
      tiles_(header.tiles),
      extent_(header.extent()),
      has_normals_(header.of_mesh.has_normals) {
  const std::string text = to_text(header);
  const PieceStart start{.header_bytes = static_cast<std::uint32_t>(text.size())};
  append(std::span(&start, 1));
  append(std::span(text));
}

template <class T>
void PieceWriter::append(std::span<const T> items) {
  const auto bytes = std::as_bytes(items);
  end_.content_crc32c = crc32c(bytes, end_.content_crc32c);
  out_.append(bytes);
}

void PieceWriter::place(const TilePlace& tile) {
  const std::lock_guard lock(mutex_);
  places_.push_back(tile);
}

/// The next tile that has anything; nothing where none is placed.
std::optional<TilePlace> PieceWriter::take_place() {
  const std::lock_guard lock(mutex_);
  while (!places_.empty()) {
    const TilePlace first = places_.front();
    places_.pop_front();
    end_.degenerate += first.degenerate;
    if (first.vertices > 0 || first.triangles > 0) return first;
  }
  return std::nullopt;
}

/// All of them are placed before the first tile of the part.
void PieceWriter::write_neighbours() {
  if (std::exchange(has_neighbours_, true)) return;
  std::vector<PieceTile> tiles;
  {
    const std::lock_guard lock(mutex_);
    for (; !places_.empty() && places_.front().code < tiles_.begin; places_.pop_front())
      if (places_.front().vertices > 0)
        tiles.push_back({places_.front().code, places_.front().vertices, 0});
  }
  end_.neighbours = tiles.size();
  append(std::span<const std::uint64_t>(&end_.neighbours, 1));
  append(std::span<const PieceTile>(tiles));
}

void PieceWriter::write(const MeshChunk& chunk) {
  write_neighbours();
  std::size_t v = 0, t = 0;
  while (v < chunk.positions.size() || t < chunk.triangles.size()) {
    const auto place = take_place();
    if (!place) throw Error("a chunk of a mesh has tiles that were not placed");
    const PieceTile tile{place->code, place->vertices, place->triangles};
    append(std::span(&tile, 1));
    append(chunk.positions.subspan(v, tile.vertices));
    if (has_normals_) append(chunk.normals.subspan(v, tile.vertices));
    append(chunk.triangles.subspan(t, tile.triangles));
    v += tile.vertices;
    t += tile.triangles;
    ++end_.tiles;
    end_.largest_tile = std::max(end_.largest_tile, content_bytes(tile, has_normals_));
  }
  end_.vertices += v;
  end_.triangles += t;
}

void PieceWriter::finish() {
  write_neighbours();
  if (take_place()) throw Error("a mesh lacks tiles that were placed");
  end_.bytes = bytes() + sizeof end_;
  const auto all = std::as_bytes(std::span(&end_, 1));
  end_.own_crc32c = crc32c(all.first(sizeof end_ - sizeof end_.own_crc32c));
  out_.append(all);
}

std::uint64_t PieceWriter::memory() const {
  const Int3 tiles = ceil_div(extent_, {kTileEdge, kTileEdge, kTileEdge});
  // A tile before the part waits for one of the part: no more than boundaries do.
  return tiles_.begin == 0 ? 0
                           : BoundaryMap::max_size(tiles) * (sizeof(TilePlace) + sizeof(PieceTile));
}

}  // namespace isobrick
