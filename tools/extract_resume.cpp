#include <filesystem>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <isobrick/error.h>
#include <isobrick/pieces.h>
#include "io/bytes/output_guard.h"
#include "tools/extract_part.h"
#include "tools/interrupt.h"
#include "tools/merge.h"
#include "tools/output_name.h"

namespace isobrick::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

/// Active blocks of a piece: some hundred megabytes of mesh mostly, and seconds of work. Every
/// piece searches the ranges of the volume once more, so that huge volumes have larger ones.
constexpr std::uint64_t kBlocksOfPiece = std::uint64_t{1} << 13;
constexpr std::uint64_t kMaxPieces = 500;

void check_resume_arguments(const ExtractArguments& arguments) {
  const std::pair<bool, const char*> others[] = {
      {!arguments.preview.path.empty(), "--preview"},
      {arguments.backend == Backend::cuda, "--backend cuda"}};
  for (const auto& [is_given, name] : others)
    if (is_given)
      throw UsageError(
          fmt::format("--resume: {} is not made by way of pieces: leave out one of them", name));
  if (is_standard_output(arguments.output))
    throw UsageError("--resume: what goes to standard output cannot go on: name a file with -o");
}

/// By the surface alone, so that the next run finds the same parts.
std::uint32_t count_parts(const StoreReader& store, ExtractOptions options) {
  options.index = {.automatic = false, .kind = {}};
  const std::uint64_t blocks = count_active(store, options).active_blocks;
  return static_cast<std::uint32_t>(
      std::clamp<std::uint64_t>((blocks + kBlocksOfPiece - 1) / kBlocksOfPiece, 1, kMaxPieces));
}

/// Adds what a part took.
void add_report(const ExtractReport& part, ExtractReport& all) {
  all.bricks = part.bricks;
  all.active_bricks = part.active_bricks;
  all.index = part.index;
  all.bricks_read += part.bricks_read;
  all.brick_reads += part.brick_reads;
  all.bytes_read += part.bytes_read;
  all.seconds += part.seconds;
  all.plan_seconds += part.plan_seconds;
  all.decode_seconds += part.decode_seconds;
  all.surface_seconds += part.surface_seconds;
  all.search_bytes += part.search_bytes;
  all.search_seconds += part.search_seconds;
  const auto add = [](const StageReport& from, StageReport& to) {
    to.seconds += from.seconds;
    to.bytes += from.bytes;
  };
  add(part.read, all.read);
  add(part.decode, all.decode);
  add(part.surface, all.surface);
  add(part.sink, all.sink);
}

/// The pieces of a surface.
struct MadePieces {
  fs::path folder;
  std::vector<fs::path> paths;
  std::size_t kept = 0;
  ExtractReport report;
};

MadePieces make_pieces(const ExtractedSurface& surface, const StoreReader& store,
                       Console& console) {
  MadePieces made;
  made.folder = surface.output;
  made.folder += ".pieces";
  std::error_code failure;
  fs::create_directory(made.folder, failure);
  if (failure) throw system_error("create", made.folder.string(), failure.value());
  const std::uint32_t parts = count_parts(store, surface.options);
  for (std::uint32_t i = 1; i <= parts; ++i) {
    made.paths.push_back(made.folder / fmt::format("{}of{}{}", i, parts, kPieceExtension));
    const PieceReport piece = extract_piece(store, surface.options, {i, parts}, made.paths.back(),
                                            false, console.progress());
    made.kept += piece.is_kept;
    add_report(piece.surface, made.report);
  }
  return made;
}

/// The folder goes if nobody put anything else into it.
void remove_pieces(const MadePieces& pieces) {
  std::error_code ignored;
  for (const fs::path& path : pieces.paths) fs::remove(path, ignored);
  fs::remove(pieces.folder, ignored);
}

}  // namespace

CommandOutput make_resumable(const ExtractArguments& arguments,
                             const std::vector<ExtractedSurface>& surfaces,
                             const StoreReader& store, Console& console) {
  check_resume_arguments(arguments);
  if (!arguments.no_space_check) check_space(surfaces, store);
  const std::vector<fs::path> inputs{arguments.input.path};
  for (const ExtractedSurface& surface : surfaces) {
    check_replaces_no_input(surface.output, inputs);
    check_can_write_mesh(surface.output, surface.form.format, arguments.force);
  }
  set_interrupt_note([] { return "the same command goes on with the pieces that are whole"; });
  CommandOutput result;
  std::vector<ExtractReport> reports;
  std::vector<std::string> names;
  for (const ExtractedSurface& surface : surfaces) {
    MadePieces pieces = make_pieces(surface, store, console);
    const MergeResult made = merge({.pieces = pieces.paths,
                                    .output = surface.output,
                                    .form = surface.form,
                                    .filter = surface.filter,
                                    .attributes = arguments.attributes,
                                    .memory = arguments.memory,
                                    .threads = arguments.threads,
                                    .force = arguments.force,
                                    .no_space_check = arguments.no_space_check},
                                   console);
    remove_pieces(pieces);
    ExtractReport& report = pieces.report;
    report.triangles = made.size.triangles;
    report.vertices = made.size.vertices;
    report.degenerate_triangles = made.pieces.degenerate;
    report.seconds += made.seconds;
    report.pass = reports.size();
    ordered_json object = report_json(surface, report, made.filtered, made.bytes);
    object["pieces"] = {{"total", pieces.paths.size()}, {"kept", pieces.kept}};
    result.objects.push_back(std::move(object));
    result.text += report_text(surface, report, made.filtered, made.bytes, true);
    if (pieces.kept > 0)
      result.text +=
          fmt::format("  went on with {} of {} pieces\n", pieces.kept, pieces.paths.size());
    reports.push_back(report);
    names.push_back(surface.output.string());
  }
  result.passes = passes_json(passes_of(reports, names));
  return result;
}

}  // namespace isobrick::tools
