#include "pipeline/pieces/piece_maker.h"

#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include <isobrick/error.h>
#include <isobrick/version.h>
#include "bricks/ranges/stored_ranges.h"
#include "io/bytes/output_file.h"
#include "pipeline/check_part.h"
#include "pipeline/extract/extract_part.h"
#include "pipeline/extract/mesh_header.h"
#include "pipeline/pieces/piece_reader.h"
#include "pipeline/pieces/piece_writer.h"

namespace isobrick::inline v0 {
namespace {

using nlohmann::json;

template <class T>
json list_of(Vec3<T> v) {
  return {v.x, v.y, v.z};
}

/// By what samples of a level are recognised, wherever the store lies.
json samples_json(const StoreReader& store, int level) {
  const StoreInfo& info = store.info();
  const LevelInfo& of_level = info.levels[static_cast<std::size_t>(level)];
  json object{{"level", level},
              {"extent", list_of(of_level.lattice.extent)},
              {"type", std::string(short_name(of_level.lattice.type))},
              {"block_range_crc32c", of_level.block_ranges_crc32c}};
  // Their checksums differ wherever a brick does.
  if (const auto stored = read_stored_ranges(*store.storage(), info.additions))
    object["brick_crc32c"] = stored->levels.at(static_cast<std::size_t>(level)).content;
  return object;
}

/// Everything that the mesh depends on.
json mesh_json(const StoreReader& store, const ExtractRequest& request, int level) {
  const SurfaceOptions& surface = request.surface;
  const Transform& transform = surface.transform;
  // JSON has no infinity.
  const json isovalue = std::isfinite(surface.isovalue) ? json(surface.isovalue)
                                                        : json(fmt::format("{}", surface.isovalue));
  return {{"isobrick", fmt::format("{}.{}.{}", ISOBRICK_VERSION_MAJOR, ISOBRICK_VERSION_MINOR,
                                   ISOBRICK_VERSION_PATCH)},
          {"samples", samples_json(store, level)},
          {"isovalue", isovalue},
          {"inside", surface.inside == Inside::below ? "below" : "above"},
          {"normals", surface.normals},
          {"drop_degenerate", surface.drop_degenerate},
          {"topology", surface.topology == Topology::trilinear ? "trilinear" : "consistent"},
          {"cap", surface.cap},
          {"region", {list_of(surface.roi.lo), list_of(surface.roi.hi)}},
          {"transform",
           {list_of(transform.spacing), list_of(transform.origin), transform.direction,
            transform.unit}}};
}

/// What the piece there holds, where it is whole and has the header `text`; nothing where it is to
/// be made. Throws UsageError where it is no piece and must stay.
std::optional<PieceEnd> find_piece(const std::filesystem::path& path, const std::string& text,
                                   bool force) {
  std::error_code none;
  if (!std::filesystem::exists(path, none)) return std::nullopt;
  check_output(path.string(), true);  // a folder or a device
  if (!looks_like_piece(path)) {
    check_output(path.string(), force);
    return std::nullopt;
  }
  try {
    PieceReader reader(path);
    if (reader.header_text() != text) return std::nullopt;
    reader.verify();
    return reader.end();
  } catch (const DamageError&) {
    return std::nullopt;
  } catch (const UsageError&) {  // of another version
    return std::nullopt;
  }
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
  return {{number, plans_.count()}, plans_.tiles(number), mesh_, header_};
}

PieceReport PieceMaker::make(std::uint32_t number, const std::filesystem::path& path, bool force,
                             Progress& progress) const {
  if (const auto end = find_piece(path, to_text(describe(number)), force)) {
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
  if (path.native() == kStandardOutput)
    throw UsageError(
        "a piece has a name, by which it is found again: it cannot go to standard output");
  const PieceMaker maker(store, options, PieceMaker::plan(store, options, part.count));
  return maker.make(part.number, path, force, progress);
}

}  // namespace isobrick
