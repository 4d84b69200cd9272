#include "pipeline/labels/label_piece_maker.h"

#include <bit>
#include <utility>

#include <isobrick/error.h>
#include "core/stopwatch.h"
#include "io/bytes/output_file.h"
#include "pipeline/check_part.h"
#include "pipeline/labels/label_piece_file.h"
#include "pipeline/labels/store_label_pass.h"

namespace isobrick::inline v0 {

PartPlans LabelPieceMaker::plan(const StoreReader& reader, const LabelOptions& options,
                                std::uint32_t parts) {
  const StoreReader store = reader.native();
  check_part({1, parts});
  const LabelImage image = label_image_of(store, options);
  // By ranges alone: tasks divide alike whether or not their stores have lists.
  PartPlans plans;
  plans.grid = store.info().levels[static_cast<std::size_t>(options.level)].lattice.tiles();
  divide_tiles(plans, parts, [&](auto&& f) {
    TileStream tiles = label_tiles(store, options.level, image, {}, false);
    while (const auto work = tiles.next())
      f(*work, static_cast<std::uint64_t>(std::popcount(work->active_blocks)));
  });
  return plans;
}

LabelPieceMaker::LabelPieceMaker(const StoreReader& store, const LabelOptions& options,
                                 PartPlans plans)
    : store_(store.native()),
      options_(options),
      plans_(std::move(plans)),
      image_(label_image_of(store_, options)),
      mesh_(label_mesh_json(store_, options, image_)) {}

LabelPieceReport LabelPieceMaker::make(std::uint32_t number, const std::filesystem::path& path,
                                       bool force, Progress& progress) const {
  const LabelPieceDescription description{{{number, plans_.count()}, plans_.tiles(number), mesh_},
                                          store_.info().name};
  LabelPieceReport report;
  const auto take = [&](const PieceEnd& end) {
    report.pass.vertices = end.vertices;
    report.pass.triangles = end.triangles;
    report.bytes = end.bytes;
  };
  if (const auto end = find_piece(path, PieceKind::labels, to_text(description), force)) {
    report.is_kept = true;
    take(*end);
    return report;
  }
  double seconds = 0;
  {
    const Stopwatch watch(seconds);
    OutputFile out(path.string(), true);
    LabelPieceWriter writer(out.writer(), description);
    report.pass = run_label_pass(
        store_, options_, image_, plan_label_memory(store_, options_), plans_.tiles(number),
        [&](std::span<const std::byte> packed) { writer.append(packed); }, progress);
    take(writer.finish());
    out.publish();
  }
  report.pass.seconds = seconds;
  return report;
}

LabelPieceReport extract_label_piece(const StoreReader& store, const LabelOptions& options,
                                     Part part, const std::filesystem::path& path, bool force,
                                     Progress& progress) {
  check_part(part);
  check_piece_name(path);
  const LabelPieceMaker maker(store, options, LabelPieceMaker::plan(store, options, part.count));
  return maker.make(part.number, path, force, progress);
}

}  // namespace isobrick
