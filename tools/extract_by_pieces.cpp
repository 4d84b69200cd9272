#include <filesystem>
#include <regex>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <isobrick/error.h>
#include <isobrick/pieces.h>
#include "core/stopwatch.h"
#include "io/bytes/output_guard.h"
#include "pipeline/pieces/piece_maker.h"
#include "ranks/piece_sums.h"
#include "ranks/share_plans.h"
#include "ranks/write_ply.h"
#include "ranks/write_pvtp.h"
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
/// A device makes a piece in milliseconds, and takes as long to begin one.
constexpr std::uint64_t kBlocksOfPieceOnDevice = std::uint64_t{1} << 16;
/// Where devices share a surface and keep no pieces, one that is lost is no reason for many.
constexpr std::uint64_t kBlocksOfSharedPiece = std::uint64_t{1} << 22;

/// Of one rank, so that no rank waits long for the last piece.
constexpr std::uint64_t kPiecesOfRank = 4;
constexpr std::uint64_t kFewestBlocks = 256;

std::uint32_t count_parts(const StoreReader& store, ExtractOptions options, const Ranks* job) {
  options.index = {.automatic = false, .kind = {}};
  return count_pieces(count_active(store, options).active_blocks, job,
                      options.backend == Backend::cuda);
}

SummedMembers<ExtractReport> summed_members() {
  using Report = ExtractReport;
  return {{&Report::degenerate_triangles, &Report::bricks_read, &Report::brick_reads,
           &Report::bytes_read, &Report::search_bytes, &Report::launches},
          {&Report::plan_seconds, &Report::decode_seconds, &Report::surface_seconds,
           &Report::search_seconds},
          {&Report::read, &Report::decode, &Report::surface, &Report::sink, &Report::upload,
           &Report::gather, &Report::kernel, &Report::download}};
}

/// Whether the ranks can write their pieces of the mesh as they are.
bool is_written_by_all(const ExtractArguments& arguments, const ExtractedSurface& surface) {
  return (surface.form.format == MeshFormat::ply || surface.form.format == MeshFormat::pvtp) &&
         !surface.filter.any() && arguments.attributes.empty();
}

/// Of a rank's budget, what pieces may take that wait for their places in the mesh.
std::uint64_t spool_memory(const ExtractArguments& arguments) {
  constexpr std::uint64_t enough_for_both = std::uint64_t{512} << 20;
  return arguments.memory >= enough_for_both ? arguments.memory / 2 : 0;
}

/// The pieces of a surface.
struct MadePieces {
  fs::path folder;              ///< of `paths`; none where ranks write the mesh at once
  std::vector<fs::path> paths;  ///< of all parts
  std::vector<OwnPiece> own;    ///< those that this rank made
  std::uint32_t total = 0;
  std::uint64_t kept = 0;
  ExtractReport report;
};

/// Makes the pieces of one surface, alone or with the other ranks.
class PieceWork {
 public:
  PieceWork(const ExtractedSurface& surface, const PieceMaker& maker, Ranks* job, Console& console)
      : surface_(surface), maker_(maker), job_(job), console_(console) {
    made_.total = maker.parts().count();
  }

  /// In a folder beside the mesh, where those that are whole are kept.
  MadePieces in_files() {
    made_.folder = surface_.output;
    made_.folder += ".pieces";
    create_piece_folder(made_.folder);
    for (std::uint32_t i = 1; i <= made_.total; ++i)
      made_.paths.push_back(made_.folder /
                            fmt::format("{}of{}{}", i, made_.total, kPieceExtension));
    deal_out([&](std::uint32_t number) {
      const fs::path& path = made_.paths[number - 1];
      take(maker_.make(number, path, false, console_.progress()));
      made_.own.push_back({number, open_piece_file(path)});
    });
    return std::move(made_);
  }

  /// In so many bytes of memory, and files without names where they do not suffice.
  MadePieces in_memory(std::uint64_t memory) {
    deal_out([&](std::uint32_t number) {
      auto piece = std::make_shared<BufferedPiece>(
          open_scratch_beside(surface_.output.string(), static_cast<std::size_t>(memory)));
      take(maker_.append(number, piece->writer(), console_.progress()));
      memory -= std::min(memory, piece->size());
      made_.own.push_back({number, std::move(piece)});
    });
    return std::move(made_);
  }

 private:
  template <class F>
  void deal_out(F&& make) {
    if (job_ == nullptr) {
      for (std::uint32_t number = 1; number <= made_.total; ++number) make(number);
    } else {
      deal(*job_, made_.total, [&](std::uint64_t i) { make(static_cast<std::uint32_t>(i + 1)); });
      sums_.gather(*job_);
    }
    made_.kept = sums_.kept();
    sums_.put(made_.report);
  }

  void take(const PieceReport& piece) {
    made_.report.active_bricks = piece.surface.active_bricks;
    made_.report.index = piece.surface.index;
    made_.report.backend = piece.surface.backend;
    made_.report.device = piece.surface.device;
    made_.report.gpu_refusal = piece.surface.gpu_refusal;
    made_.report.device_bytes = std::max(made_.report.device_bytes, piece.surface.device_bytes);
    made_.report.device_bytes_in_use =
        std::max(made_.report.device_bytes_in_use, piece.surface.device_bytes_in_use);
    made_.report.pinned_bytes = std::max(made_.report.pinned_bytes, piece.surface.pinned_bytes);
    made_.report.pool_bricks = std::max(made_.report.pool_bricks, piece.surface.pool_bricks);
    sums_.add(piece.surface, piece.is_kept);
  }

  const ExtractedSurface& surface_;
  const PieceMaker& maker_;
  Ranks* job_;
  Console& console_;
  PieceSums<ExtractReport> sums_{summed_members()};
  MadePieces made_;
};

/// Whether a file is named as ours are, "3of8.piece": also one of an earlier run with other parts.
bool is_own_piece(const fs::path& path) {
  static const std::regex name("[0-9]+of[0-9]+\\.piece");
  return std::regex_match(path.filename().string(), name);
}

/// What became of the pieces of a surface.
MergeResult put_together(const ExtractArguments& arguments, const ExtractedSurface& surface,
                         const PieceMaker& maker, MadePieces& pieces, Ranks* job,
                         Console& console) {
  MergeResult made;
  if (job != nullptr && is_written_by_all(arguments, surface)) {
    const Stopwatch watch(made.seconds);
    auto& progress = console.progress();
    if (surface.form.format == MeshFormat::pvtp)
      made.size = write_pvtp(*job, maker.parts(), std::move(pieces.own), maker.header(),
                             surface.output, arguments.force, progress);
    else
      made.size = write_ply(*job, maker.parts(), std::move(pieces.own), maker.header(),
                            surface.output, arguments.force, progress);
    made.filtered.extracted = made.size;
    made.bytes = mesh_bytes(surface.output);
    if (made.size.triangles == 0)
      console.note(fmt::format("isovalue {}: the surface is empty", surface.options.isovalue));
  } else if (job == nullptr || job->rank() == 0) {
    made = merge({.pieces = pieces.paths,
                  .output = surface.output,
                  .form = surface.form,
                  .filter = surface.filter,
                  .attributes = arguments.attributes,
                  .colours = arguments.colours,
                  .memory = arguments.memory,
                  .threads = arguments.threads,
                  .force = arguments.force,
                  .no_space_check = arguments.no_space_check},
                 console);
  }
  if (job == nullptr || job->rank() == 0) remove_piece_folder(pieces.folder);
  if (job != nullptr) job->wait_for_all();
  return made;
}

/// Refuses what would stop the command after its work; of a job one rank looks.
void check_outputs_of(const ExtractArguments& arguments,
                      const std::vector<ExtractedSurface>& surfaces, const StoreReader& store,
                      Ranks* job) {
  if (job == nullptr || job->rank() == 0) {
    if (!arguments.no_space_check) check_space(surfaces, store);
    const std::vector<fs::path> inputs{arguments.input.path};
    for (const ExtractedSurface& surface : surfaces) {
      check_replaces_no_input(surface.output, inputs);
      check_can_write_mesh(surface.output, surface.form.format, arguments.force);
    }
  }
  if (job != nullptr) job->wait_for_all();
}

}  // namespace

std::uint32_t count_pieces(std::uint64_t active_blocks, const Ranks* job, bool on_device) {
  const auto pieces = [&](std::uint64_t size) {
    return std::max<std::uint64_t>(1, (active_blocks + size - 1) / size);
  };
  const auto ranks = static_cast<std::uint64_t>(job != nullptr ? job->size() : 0);
  const std::uint64_t size = !on_device       ? kBlocksOfPiece
                             : job == nullptr ? kBlocksOfPieceOnDevice
                                              : kBlocksOfSharedPiece;
  const std::uint64_t for_ranks = ranks * (on_device ? 1 : kPiecesOfRank);
  return static_cast<std::uint32_t>(
      std::max(std::min(pieces(size), kMaxPieces),
               std::min({for_ranks, pieces(kFewestBlocks), std::uint64_t{kMaxParts}})));
}

void create_piece_folder(const fs::path& folder) {
  std::error_code failure;
  fs::create_directory(folder, failure);
  if (failure) throw system_error("create", folder.string(), failure.value());
}

void remove_piece_folder(const fs::path& folder) {
  if (folder.empty()) return;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored))
    if (is_own_piece(entry.path())) fs::remove(entry.path(), ignored);
  fs::remove(folder, ignored);
}

void check_piece_arguments(const ExtractArguments& arguments, std::string_view reason) {
  if (!arguments.preview.path.empty())
    throw UsageError(
        fmt::format("{}: --preview is not made by way of pieces: leave out one of them", reason));
  if (is_standard_output(arguments.output))
    throw UsageError(fmt::format("{}: pieces lie beside the mesh: name a file with -o", reason));
}

CommandOutput make_by_pieces(const ExtractArguments& arguments,
                             const std::vector<ExtractedSurface>& surfaces,
                             const StoreReader& store, Ranks* job, Console& console) {
  check_piece_arguments(arguments, job != nullptr ? "several ranks" : "--resume");
  check_outputs_of(arguments, surfaces, store, job);
  if (job == nullptr || (arguments.resume && job->rank() == 0))
    set_interrupt_note([] { return "the same command goes on with the pieces that are whole"; });
  CommandOutput result;
  std::vector<ExtractReport> reports;
  std::vector<std::string> names;
  for (const ExtractedSurface& surface : surfaces) {
    double seconds = 0;
    MergeResult made;
    MadePieces pieces;
    {
      const Stopwatch watch(seconds);
      // Pieces of a mesh that all ranks write are kept for a later run only on request.
      const bool spools =
          job != nullptr && !arguments.resume && is_written_by_all(arguments, surface);
      const std::uint64_t memory = spools ? spool_memory(arguments) : 0;
      ExtractOptions options = surface.options;
      options.memory -= memory;
      options.memory_of_others += memory;
      const auto plan = [&] {
        return PieceMaker::plan(store, options, count_parts(store, options, job));
      };
      const PieceMaker maker(store, options, job != nullptr ? share_plans(*job, plan) : plan());
      PieceWork work(surface, maker, job, console);
      pieces = spools ? work.in_memory(memory) : work.in_files();
      made = put_together(arguments, surface, maker, pieces, job, console);
    }
    ExtractReport& report = pieces.report;
    const LevelInfo& level = store.info().levels[static_cast<std::size_t>(surface.options.level)];
    report.bricks = static_cast<std::uint64_t>(volume(level.lattice.bricks()));
    report.bricks_read = std::min(report.bricks_read, report.bricks);  // some for several pieces
    report.triangles = made.size.triangles;
    report.vertices = made.size.vertices;
    report.seconds = seconds;
    report.pass = reports.size();
    ordered_json object = report_json(surface, report, made.filtered, made.bytes);
    object["pieces"] = {{"total", pieces.total}, {"kept", pieces.kept}};
    result.objects.push_back(std::move(object));
    result.text += report_text(surface, report, made.filtered, made.bytes, true);
    if (pieces.kept > 0)
      result.text += fmt::format("  went on with {} of {} pieces\n", pieces.kept, pieces.total);
    reports.push_back(report);
    names.push_back(surface.output.string());
  }
  result.passes = passes_json(passes_of(reports, names));
  return result;
}

}  // namespace isobrick::tools
