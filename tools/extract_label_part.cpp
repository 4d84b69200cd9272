#include <array>
#include <filesystem>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <isobrick/label_pieces.h>
#include "core/stopwatch.h"
#include "io/bytes/folder_walk.h"
#include "io/bytes/output_guard.h"
#include "pipeline/labels/label_piece_maker.h"
#include "ranks/label_piece_files.h"
#include "tools/extract_labels.h"
#include "tools/extract_part.h"
#include "tools/format.h"
#include "tools/interrupt.h"
#include "tools/output_name.h"

namespace isobrick::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

/// The piece of labels: "cells_labels_3of8.piece" where no name is given.
fs::path label_piece_name(const ExtractArguments& arguments) {
  if (!arguments.output.empty()) return arguments.output;
  return fmt::format("{}_labels_{}of{}{}",
                     stem_of_input(arguments.input.path, arguments.input.volume),
                     arguments.part->number, arguments.part->count, kPieceExtension);
}

ordered_json label_piece_json(const ExtractArguments& arguments, const fs::path& path,
                              const LabelPieceReport& report) {
  return {{"command", "extract"},
          {"input", arguments.input.path},
          {"level", *arguments.level},
          {"part", {{"number", arguments.part->number}, {"count", arguments.part->count}}},
          {"output", path.string()},
          {"output_bytes", report.bytes},
          {"triangles", report.pass.triangles},
          {"vertices", report.pass.vertices},
          {"bricks", {{"total", report.pass.bricks}, {"read", report.pass.bricks_read}}},
          {"brick_reads", report.pass.brick_reads},
          {"bytes_read", report.pass.bytes_read},
          {"index_bytes", report.pass.index_bytes},
          {"seconds", report.pass.seconds},
          {"kept", report.is_kept},
          {"peak_resident_bytes", peak_resident_bytes()}};
}

std::string label_piece_text(const ExtractArguments& arguments, const fs::path& path,
                             const LabelPieceReport& report) {
  std::string text = fmt::format("part {} of {}: ", arguments.part->number, arguments.part->count);
  if (report.is_kept)
    text += fmt::format("is there already, {} triangles", human_count(report.pass.triangles));
  else
    text += fmt::format("{} triangles from {} of {} bricks in {}",
                        human_count(report.pass.triangles), human_count(report.pass.bricks_read),
                        human_count(report.pass.bricks), human_seconds(report.pass.seconds));
  return text + fmt::format("\n  {} ({})\n", path.string(), human_bytes(report.bytes));
}

}  // namespace

int run_extract_label_part(const ExtractArguments& given, Console& console) {
  check_part_arguments(given);
  check_label_arguments(given);
  check_filters(given.filters, false);
  const fs::path path = label_piece_name(given);
  check_replaces_no_input(path, std::array<fs::path, 1>{given.input.path});
  const OpenedVolume input = open_input(given.input, given.memory, given.threads, console);
  const StoreReader& store = input.store();
  set_interrupt_note([] { return "the same command begins the piece anew"; });
  const LabelPieceReport report = extract_label_piece(
      store, label_options(given, store), *given.part, path, given.force, console.progress());
  console.result(label_piece_json(given, path, report), label_piece_text(given, path, report));
  return 0;
}

LabelsByPieces make_labels_by_pieces(const LabelOutput& output, const LabelListing& listing,
                                     const StoreReader& store, const LabelOptions& options,
                                     Ranks* job, Console& console) {
  if (job == nullptr)
    set_interrupt_note([] { return "the same command goes on with the pieces that are whole"; });
  const fs::path folder = without_slash(output.folder) += ".pieces";
  LabelPieceFiles pieces;
  const auto make_pieces = [&] {
    create_piece_folder(folder);
    const auto plan = [&] {
      const std::uint64_t blocks =
          LabelPieceMaker::plan(store, options, 1).parts.front().active_blocks;
      return LabelPieceMaker::plan(store, options, count_pieces(blocks, job));
    };
    pieces = make_label_pieces(job, store, options, plan, folder, console.progress());
  };
  LabelsByPieces made;
  double seconds = 0;
  if (job != nullptr && job->rank() > 0) {
    make_pieces();
  } else {
    const Stopwatch watch(seconds);
    made.written = write_labels(output, listing, [&](const LabelTarget& target) {
      make_pieces();
      return merge_labels(output, pieces.paths, target, console.progress());
    });
    remove_piece_folder(folder);
  }
  if (job != nullptr) job->wait_for_all();
  LabelReport& report = made.written.report;
  report.bricks = pieces.pass.bricks;
  report.bricks_read = pieces.pass.bricks_read;
  report.brick_reads = pieces.pass.brick_reads;
  report.bytes_read = pieces.pass.bytes_read;
  report.index_bytes = pieces.pass.index_bytes;
  report.seconds = seconds;
  made.total = pieces.paths.size();
  made.kept = pieces.kept;
  return made;
}

}  // namespace isobrick::tools
