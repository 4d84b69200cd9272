#include <fmt/format.h>

#include <isobrick/error.h>
#include <isobrick/label_pieces.h>
#include "core/cancellable_progress.h"
#include "core/length_unit.h"
#include "core/stopwatch.h"
#include "pipeline/labels/label_meshes.h"
#include "pipeline/labels/label_piece_file.h"
#include "pipeline/labels/label_plan.h"
#include "pipeline/pieces/piece_set.h"
#include "pipeline/program_memory.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

/// The pieces of the same labels, and what is known of these.
struct LabelPieces {
  PieceSet set;
  LabelPieceDescription first;
  std::uint64_t merge_memory = 0;
};

LabelPieces collect_label_pieces(std::span<const fs::path> paths) {
  LabelPieces pieces;
  PieceCollector collector(paths);
  for (const fs::path& path : paths) {
    const LabelPieceReader reader(path);
    collector.add(reader.description(), reader.end());
    if (reader.description().part.number == 1 || &path == &paths.front())
      pieces.first = reader.description();
  }
  pieces.set = std::move(collector).collected();
  pieces.merge_memory = kProgramBytes + pieces.set.memory() + PieceInput::kBuffer +
                        2 * pieces.set.largest_tile + kLeastForLabels;
  return pieces;
}

/// Bytes for what is known of each label.
std::uint64_t plan_label_bytes(const LabelPieces& pieces, std::uint64_t memory) {
  if (memory < pieces.merge_memory)
    throw UsageError(fmt::format(
        "a memory budget of {:.1f} MiB is too small: at least --memory {}M is needed, {:.1f} MiB "
        "of it for the program and its libraries",
        in_mib(memory), mib_above(pieces.merge_memory), in_mib(kProgramBytes)));
  return kLeastForLabels + (memory - pieces.merge_memory) / 4;
}

void append_piece(const PieceSet::Piece& piece, LabelMeshes& meshes, Progress& progress) {
  LabelPieceReader reader(piece.path);
  if (!piece.is_same(reader.end())) reader.fail("has changed meanwhile");
  std::uint64_t reported = 0;
  for (auto record = reader.next(); !record.empty(); record = reader.next()) {
    meshes.append(record);
    progress.advance(record.size());
    reported += record.size();
  }
  progress.advance(piece.bytes - std::min(piece.bytes, reported));
}

}  // namespace

bool is_label_piece(const fs::path& path) { return find_piece_kind(path) == PieceKind::labels; }

LabelPiecesInfo read_label_pieces(std::span<const fs::path> pieces) {
  const LabelPieces all = collect_label_pieces(pieces);
  return {.name = all.first.name,
          .level = all.first.level(),
          .unit = unit_name(all.first.image().transform.unit),
          .labels = all.first.properties(),
          .size = {all.set.vertices, all.set.triangles},
          .bytes = all.set.bytes,
          .merge_memory = all.merge_memory};
}

LabelReport merge_label_pieces(std::span<const fs::path> pieces, const LabelMergeOptions& options,
                               const LabelVisitor& visit, Progress& progress) {
  LabelReport report;
  double seconds = 0;
  {
    const Stopwatch watch(seconds);
    const LabelPieces all = collect_label_pieces(pieces);
    const LabelImage image = all.first.image();
    Workers workers(options.threads);
    const int visits = options.visits > 0 ? options.visits : workers.threads();
    LabelMeshes meshes(image, {.scratch_beside = options.scratch_beside,
                               .label_bytes = plan_label_bytes(all, options.memory),
                               .at_a_time = static_cast<std::size_t>(visits),
                               .cancel = options.cancel,
                               .check_totals = options.check_totals});
    CancellableProgress cancellable(progress, options.cancel);
    cancellable.begin("merging", all.set.bytes);
    for (const PieceSet::Piece& piece : all.set.pieces) append_piece(piece, meshes, cancellable);
    cancellable.end();
    report = meshes.finish(workers, visit, progress);
    report.bytes_read = all.set.bytes;
  }
  report.seconds = seconds;
  return report;
}

}  // namespace isobrick
