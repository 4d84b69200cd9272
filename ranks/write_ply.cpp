#include "ranks/write_ply.h"

#include <optional>
#include <string>
#include <vector>

#include "io/bytes/output_file.h"
#include "io/meshes/ply_format.h"
#include "ranks/shared_writing.h"

namespace isobrick::inline v0 {
namespace {

/// Writes the vertices and faces of pieces to their places in a PLY.
class PlyCopy {
 public:
  PlyCopy(SharedFile& file, const MeshHeader& header, MeshSize mesh)
      : file_(file),
        row_(row_bytes(header.has_normals)),
        vertices_at_(ply_header(header, mesh).size()),
        faces_at_(vertices_at_ + mesh.vertices * row_),
        tiles_(header) {}

  void copy(const OwnPiece& piece, const PiecePlace& place, Progress& progress) {
    RunWriter vertices(file_, vertices_at_ + place.before.vertices * row_);
    RunWriter faces(file_, faces_at_ + place.before.triangles * kPlyFaceBytes);
    tiles_.for_each(piece, place, progress, [&](const PlacedTile& tile) {
      append_rows(vertices, tile.positions, tile.normals);
      for (const Triangle& triangle : tile.triangles)
        put_ply_face(faces.append(kPlyFaceBytes), triangle);
    });
    vertices.flush();
    faces.flush();
  }

 private:
  SharedFile& file_;
  std::size_t row_;
  std::uint64_t vertices_at_, faces_at_;
  PlacedTiles tiles_;
};

}  // namespace

MeshSize write_ply(Ranks& ranks, const PartPlans& parts, std::vector<OwnPiece> pieces,
                   const MeshHeader& header, const std::filesystem::path& path, bool force,
                   Progress& progress) {
  const PiecePlaces places = find_places(ranks, parts, pieces);
  check_ply_vertices(places.mesh.vertices, path.string());
  std::optional<OutputFile> out;
  if (ranks.rank() == 0) out.emplace(path.string(), force);
  const auto file =
      ranks.open_file(text_from_first(ranks, out ? out->temporary_path() : std::string()));
  progress.begin("writing", bytes_of(pieces));
  const std::string text = ply_header(header, places.mesh);
  if (out) file->write_at(0, std::as_bytes(std::span(text)));
  PlyCopy copy(*file, header, places.mesh);
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
