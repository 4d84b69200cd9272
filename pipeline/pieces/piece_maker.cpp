#include "pipeline/pieces/piece_maker.h"

#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include <isobrick/error.h>
#include "io/bytes/output_file.h"
#include "pipeline/check_part.h"
#include "pipeline/extract/extract_part.h"
#include "pipeline/extract/mesh_header.h"
#include "pipeline/pieces/piece_identity.h"
#include "pipeline/pieces/piece_input.h"
#include "pipeline/pieces/piece_writer.h"

namespace isobrick::inline v0 {
namespace {

using nlohmann::json;

/// Everything that the mesh depends on.
json mesh_json(const StoreReader& store, const ExtractRequest& request, int level) {
  const SurfaceOptions& surface = request.surface;
  // JSON has no infinity.
  const json isovalue = std::isfinite(surface.isovalue) ? json(surface.isovalue)
                                                        : json(fmt::format("{}", surface.isovalue));
  return {{"isobrick", version_text()},
          {"samples", samples_json(store, level)},
          {"isovalue", isovalue},
          {"inside", surface.inside == Inside::below ? "below" : "above"},
          {"normals", surface.normals},
          {"drop_degenerate", surface.drop_degenerate},
          {"topology", surface.topology == Topology::trilinear ? "trilinear" : "consistent"},
          {"cap", surface.cap},
          {"region", box_json(surface.roi)},
          {"transform", transform_json(surface.transform)}};
}

}  // namespace

PartPlans PieceMaker::plan(const StoreReader& store, const ExtractOptions& options,
                           std::uint32_t parts) {
  check_part({1, parts});
  return plan_parts(store, check_request(store, options, Indexing::welded), options.level, parts);
}

PieceMaker::PieceMaker(const StoreReader& store, const ExtractOptions& options, PartPlans plans)
    : store_(store), options_(options), plans_(std::move(plans)) {
  const ExtractRequest request = check_request(store, options, Indexing::welded);
  header_ = mesh_header(request.level->transform, request.level->lattice.extent,
                        request.surface.normals, plans_.bounds);
  mesh_ = mesh_json(store, request, options.level);
}

PieceDescription PieceMaker::describe(std::uint32_t number) const {
  return {{{number, plans_.count()}, plans_.tiles(number), mesh_}, header_};
}

PieceReport PieceMaker::make(std::uint32_t number, const std::filesystem::path& path, bool force,
                             Progress& progress) const {
  if (const auto end = find_piece(path, PieceKind::surface, to_text(describe(number)), force)) {
    PieceReport report;
    report.is_kept = true;
    report.surface.vertices = end->vertices;
    report.surface.triangles = end->triangles;
    report.surface.degenerate_triangles = end->degenerate;
    report.bytes = end->bytes;
    return report;
  }
  OutputFile out(path.string(), true);
  const PieceReport report = append(number, out.writer(), progress);
  out.publish();
  return report;
}

PieceReport PieceMaker::append(std::uint32_t number, FileWriter& out, Progress& progress) const {
  PieceReport report;
  PieceWriter writer(out, describe(number));
  report.surface =
      extract_part(store_, options_, {plans_.tiles(number), &writer, plans_.active_blocks(number)},
                   writer, progress);
  report.bytes = writer.end().bytes;
  return report;
}

PieceReport extract_piece(const StoreReader& store, const ExtractOptions& options, Part part,
                          const std::filesystem::path& path, bool force, Progress& progress) {
  check_part(part);
  check_piece_name(path);
  const PieceMaker maker(store, options, PieceMaker::plan(store, options, part.count));
  return maker.make(part.number, path, force, progress);
}

}  // namespace isobrick
