#include "ranks/label_piece_files.h"

#include <algorithm>

#include <fmt/format.h>

#include "pipeline/labels/label_piece_maker.h"
#include "ranks/piece_sums.h"
#include "ranks/share_plans.h"

namespace isobrick::inline v0 {
namespace {

SummedMembers<LabelReport> summed_members() {
  using Report = LabelReport;
  return {{&Report::vertices, &Report::triangles, &Report::bricks_read, &Report::brick_reads,
           &Report::bytes_read, &Report::index_bytes}};
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
  PieceSums sums(summed_members());
  const auto make = [&](std::uint64_t i) {
    const LabelPieceReport piece =
        maker.make(static_cast<std::uint32_t>(i + 1), files.paths[static_cast<std::size_t>(i)],
                   false, progress);
    sums.add(piece.pass, piece.is_kept);
  };
  if (ranks == nullptr) {
    for (std::uint64_t i = 0; i < plans.count(); ++i) make(i);
  } else {
    deal(*ranks, plans.count(), make);
    sums.gather(*ranks);
  }
  const LevelInfo& level = store.info().levels[static_cast<std::size_t>(options.level)];
  sums.put(files.pass);
  files.kept = sums.kept();
  files.pass.bricks = static_cast<std::uint64_t>(volume(level.lattice.bricks()));
  files.pass.bricks_read = std::min(files.pass.bricks_read, files.pass.bricks);  // some for several
  return files;
}

}  // namespace isobrick
