#include "ranks/label_piece_files.h"

#include <algorithm>
#include <span>

#include <fmt/format.h>

#include "pipeline/labels/label_piece_maker.h"
#include "ranks/share_plans.h"

namespace isobrick::inline v0 {
namespace {

/// What pieces took, as numbers that ranks can add up.
struct LabelSums {
  std::uint64_t kept = 0, vertices = 0, triangles = 0;
  std::uint64_t bricks_read = 0, brick_reads = 0, bytes_read = 0, index_bytes = 0;

  void add(const LabelSums& other) {
    kept += other.kept;
    vertices += other.vertices;
    triangles += other.triangles;
    bricks_read += other.bricks_read;
    brick_reads += other.brick_reads;
    bytes_read += other.bytes_read;
    index_bytes += other.index_bytes;
  }
};

LabelSums sums_of(const LabelPieceReport& piece) {
  return {.kept = piece.is_kept ? std::uint64_t{1} : 0,
          .vertices = piece.pass.vertices,
          .triangles = piece.pass.triangles,
          .bricks_read = piece.pass.bricks_read,
          .brick_reads = piece.pass.brick_reads,
          .bytes_read = piece.pass.bytes_read,
          .index_bytes = piece.pass.index_bytes};
}

}  // namespace

LabelPieceFiles make_label_pieces(Ranks* ranks, const StoreReader& store,
                                  const LabelOptions& options,
                                  const std::function<PartPlans()>& plan,
                                  const std::filesystem::path& folder, Progress& progress) {
  const PartPlans plans = ranks != nullptr ? share_plans(*ranks, plan) : plan();
  const LabelPieceMaker maker(store, options, plans);
  LabelPieceFiles files;
  for (std::uint32_t i = 1; i <= plans.count(); ++i)
    files.paths.push_back(folder / fmt::format("{}of{}.piece", i, plans.count()));
  LabelSums sums;
  const auto make = [&](std::uint64_t i) {
    sums.add(sums_of(maker.make(static_cast<std::uint32_t>(i + 1),
                                files.paths[static_cast<std::size_t>(i)], false, progress)));
  };
  if (ranks == nullptr) {
    for (std::uint64_t i = 0; i < plans.count(); ++i) make(i);
  } else {
    deal(*ranks, plans.count(), make);
    const auto all = ranks->gather(std::as_bytes(std::span(&sums, 1)));
    sums = {};
    for (const Ranks::Bytes& of_rank : all) sums.add(to_items<LabelSums>(of_rank).front());
  }
  const LevelInfo& level = store.info().levels[static_cast<std::size_t>(options.level)];
  files.kept = sums.kept;
  files.pass.vertices = sums.vertices;
  files.pass.triangles = sums.triangles;
  files.pass.bricks = static_cast<std::uint64_t>(volume(level.lattice.bricks()));
  files.pass.bricks_read = std::min(sums.bricks_read, files.pass.bricks);  // some for several
  files.pass.brick_reads = sums.brick_reads;
  files.pass.bytes_read = sums.bytes_read;
  files.pass.index_bytes = sums.index_bytes;
  return files;
}

}  // namespace isobrick
