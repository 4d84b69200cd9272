#include "ranks/write_pvtp.h"

#include <optional>
#include <string>
#include <utility>

#include "io/bytes/leftovers.h"
#include "io/bytes/output_file.h"
#include "io/bytes/parted_output.h"
#include "io/meshes/mesh_parts.h"
#include "io/meshes/vtp_parts.h"
#include "ranks/shared_writing.h"

namespace isobrick::inline v0 {
namespace {

/// What the first rank owns: the output, and the scratch files under temporary names, which go when
/// it does.
struct PvtpFiles {
  PvtpFiles(const std::string& path, bool force)
      : out(path, force), rows(path, true), triangles(path, true) {}

  PartedOutput out;
  OutputFile rows, triangles;  ///< never published
};

/// The names of these files, which every rank opens.
struct PvtpNames {
  std::string rows, triangles, folder;
};

PvtpNames share_names(Ranks& ranks, PvtpFiles* files) {
  const auto share = [&](const std::string& own) { return text_from_first(ranks, own); };
  if (files == nullptr) return {share({}), share({}), share({})};
  return {share(files->rows.temporary_path()), share(files->triangles.temporary_path()),
          share(files->out.parts_folder())};
}

/// Collective: writes the whole mesh into the scratch files, and finds its runs.
std::vector<MeshRun> write_scratch(Ranks& ranks, const PvtpNames& names, const MeshHeader& header,
                                   const PiecePlaces& places, std::vector<OwnPiece> pieces,
                                   std::uint64_t run_triangles, Progress& progress) {
  const auto rows_file = ranks.open_file(names.rows);
  const auto triangles_file = ranks.open_file(names.triangles);
  const std::size_t row = row_bytes(header.has_normals);
  const std::size_t triangle = header.wide ? sizeof(WideTriangle) : sizeof(Triangle);
  RunFinder finder(run_triangles);
  PlacedTiles tiles(header);
  progress.begin("writing", bytes_of(pieces));
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const PiecePlace& place = places.own[i];
    RunWriter rows(*rows_file, place.before.vertices * row);
    RunWriter triangles(*triangles_file, place.before.triangles * triangle);
    std::uint64_t first = place.before.triangles;
    const auto append = [&](auto items) {
      finder.add(first, items);
      first += items.size();
      for (const auto& item : items) std::memcpy(triangles.append(sizeof item), &item, sizeof item);
    };
    tiles.for_each(pieces[i], place, progress, [&](const PlacedTile& tile) {
      append_rows(rows, tile.positions, tile.normals);
      append(tile.triangles);
      append(tile.wide_triangles);
    });
    rows.flush();
    triangles.flush();
    pieces[i].bytes.reset();  // and the memory that it takes
  }
  rows_file->close();
  triangles_file->close();
  progress.end();
  const std::vector<RunFinder::End> own = finder.ends();
  for (const Ranks::Bytes& ends : ranks.gather(std::as_bytes(std::span(own))))
    finder.add(to_items<RunFinder::End>(ends));
  return finder.runs(places.mesh);
}

/// How many parts became of a run.
struct RunParts {
  std::uint64_t run = 0;
  std::uint32_t parts = 0;
};

/// Collective: writes the parts, each run on one rank. Returns how many each run has.
std::vector<std::uint32_t> write_parts(Ranks& ranks, const PvtpNames& names,
                                       const MeshHeader& header, const std::vector<MeshRun>& runs,
                                       std::uint64_t run_triangles, Progress& progress) {
  const File rows = open_input(names.rows), triangles = open_input(names.triangles);
  const auto reader_of = [](const File& file) {
    return
        [&file](std::uint64_t offset, std::span<std::byte> bytes) { file.read_at(offset, bytes); };
  };
  const StoredMesh mesh{.rows = reader_of(rows),
                        .triangles = reader_of(triangles),
                        .row_bytes = row_bytes(header.has_normals),
                        .wide = header.wide};
  progress.begin("writing parts", runs.size());
  std::vector<RunParts> own;
  deal(ranks, runs.size(), [&](std::uint64_t i) {
    RunParts& made = own.emplace_back(RunParts{i, 0});
    for_each_part(mesh, i, runs[i], run_triangles, [&](const MeshPart& part) {
      FileWriter out =
          create_part_file(names.folder, part_name(part.run, part.number, kVtpExtension));
      write_vtp_part(out, mesh, header, part);
      out.finish();
      ++made.parts;
    });
    progress.advance(1);
  });
  std::vector<std::uint32_t> counts(runs.size());
  for (const Ranks::Bytes& of_rank : ranks.gather(std::as_bytes(std::span(own))))
    for (const RunParts& made : to_items<RunParts>(of_rank)) counts.at(made.run) = made.parts;
  return counts;
}

}  // namespace

MeshSize write_pvtp(Ranks& ranks, const PartPlans& parts, std::vector<OwnPiece> pieces,
                    MeshHeader header, const std::filesystem::path& path, bool force,
                    Progress& progress, const PvtpLimits& limits) {
  check_pvtp_name(path.string());
  const PiecePlaces places = find_places(ranks, parts, pieces);
  header.wide = places.mesh.vertices > limits.max_narrow_vertices;
  std::optional<PvtpFiles> files;
  if (ranks.rank() == 0) files.emplace(path.string(), force);
  const PvtpNames names = share_names(ranks, files ? &*files : nullptr);
  const std::vector<MeshRun> runs = write_scratch(ranks, names, header, places, std::move(pieces),
                                                  limits.part_triangles, progress);
  const auto counts = write_parts(ranks, names, header, runs, limits.part_triangles, progress);
  if (files) {
    files->out.index().writer().append(pvtp_index(header, files->out, counts));
    files->out.publish();
  }
  ranks.wait_for_all();
  progress.end();
  return places.mesh;
}

}  // namespace isobrick
