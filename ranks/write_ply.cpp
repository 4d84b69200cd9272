#include "ranks/write_ply.h"

#include <optional>
#include <string>
#include <vector>

#include "io/bytes/output_file.h"
#include "io/meshes/ply_format.h"
#include "io/meshes/vertex_rows.h"
#include "pipeline/pieces/piece_reader.h"

namespace isobrick::inline v0 {
namespace {

/// Bytes that follow each other in a file of all ranks.
class RunWriter {
 public:
  static constexpr std::size_t kBuffer = std::size_t{4} << 20;

  RunWriter(SharedFile& file, std::uint64_t offset) : file_(file), offset_(offset) {
    buffer_.reserve(kBuffer);
  }

  /// Room for so many bytes, at most kBuffer.
  std::byte* append(std::size_t bytes) {
    if (buffer_.size() + bytes > kBuffer) flush();
    buffer_.resize(buffer_.size() + bytes);
    return buffer_.data() + buffer_.size() - bytes;
  }

  void flush() {
    file_.write_at(offset_, buffer_);
    offset_ += buffer_.size();
    buffer_.clear();
  }

 private:
  SharedFile& file_;
  std::uint64_t offset_;
  std::vector<std::byte> buffer_;
};

/// Writes the vertices and faces of pieces to their places in a PLY.
class PieceCopy {
 public:
  PieceCopy(SharedFile& file, const MeshHeader& header, MeshSize mesh)
      : file_(file),
        has_normals_(header.has_normals),
        row_(row_bytes(has_normals_)),
        vertices_at_(ply_header(header, mesh).size()),
        faces_at_(vertices_at_ + mesh.vertices * row_) {}

  void copy(const OwnPiece& piece, const PiecePlace& place, Progress& progress) {
    PieceReader reader(piece.bytes);
    reader.neighbours();
    RunWriter vertices(file_, vertices_at_ + place.before.vertices * row_);
    RunWriter faces(file_, faces_at_ + place.before.triangles * kPlyFaceBytes);
    std::uint64_t own = 0;
    for (PieceTile tile; reader.next(tile);) {
      read(reader, tile);
      own += tile.vertices;
      if (!place.numbers.renumber(triangles_, place.before.vertices, own))
        reader.fail("is damaged: a triangle names a vertex that is not there");
      for (std::size_t i = 0; i < positions_.size(); ++i) {
        std::byte* const to = vertices.append(row_);
        std::memcpy(to, &positions_[i], sizeof(Vec3f));
        if (has_normals_) std::memcpy(to + sizeof(Vec3f), &normals_[i], sizeof(Vec3f));
      }
      for (const Triangle& triangle : triangles_)
        put_ply_face(faces.append(kPlyFaceBytes), triangle);
      progress.advance(content_bytes(tile, has_normals_));
    }
    vertices.flush();
    faces.flush();
  }

 private:
  void read(PieceReader& reader, const PieceTile& tile) {
    positions_.resize(tile.vertices);
    reader.read(std::span(positions_));
    normals_.resize(has_normals_ ? tile.vertices : 0);
    reader.read(std::span(normals_));
    triangles_.resize(tile.triangles);
    reader.read(std::span(triangles_));
  }

  SharedFile& file_;
  bool has_normals_;
  std::size_t row_;
  std::uint64_t vertices_at_, faces_at_;
  std::vector<Vec3f> positions_, normals_;  ///< of a tile
  std::vector<Triangle> triangles_;
};

std::uint64_t bytes_of(std::span<const OwnPiece> pieces) {
  std::uint64_t bytes = 0;
  for (const OwnPiece& piece : pieces) bytes += piece.bytes->size();
  return bytes;
}

}  // namespace

MeshSize write_ply(Ranks& ranks, const PartPlans& parts, std::vector<OwnPiece> pieces,
                   const MeshHeader& header, const std::filesystem::path& path, bool force,
                   Progress& progress) {
  const PiecePlaces places = find_places(ranks, parts, pieces);
  check_ply_vertices(places.mesh.vertices, path.string());
  std::optional<OutputFile> out;
  if (ranks.rank() == 0) out.emplace(path.string(), force);
  const std::string own_name = out ? out->temporary_path() : std::string();
  const Ranks::Bytes name = from_first(ranks, std::as_bytes(std::span(own_name)));
  const auto file =
      ranks.open_file(std::string(reinterpret_cast<const char*>(name.data()), name.size()));
  progress.begin("writing", bytes_of(pieces));
  const std::string text = ply_header(header, places.mesh);
  if (out) file->write_at(0, std::as_bytes(std::span(text)));
  PieceCopy copy(*file, header, places.mesh);
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    copy.copy(pieces[i], places.own[i], progress);
    pieces[i].bytes.reset();  // and the memory that it takes
  }
  file->close();
  if (out) out->publish();
  ranks.wait_for_all();
  progress.end();
  return places.mesh;
}

}  // namespace isobrick
