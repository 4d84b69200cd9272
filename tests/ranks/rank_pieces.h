#pragma once

#include <memory>
#include <string>
#include <vector>

#include "io/bytes/output_file.h"
#include "pipeline/pieces/piece_maker.h"
#include "ranks/piece_places.h"
#include "ranks/share_plans.h"
#include "ranks/thread_ranks.h"
#include "tests/pipeline/pieces_fixture.h"

namespace isobrick::test {

/// Pieces that ranks make, as threads of the test.
class RankPieces : public Pieces {
 protected:
  std::filesystem::path path_of(std::uint32_t number) {
    return folder_ / ("r" + std::to_string(number) + ".piece");
  }

  /// Makes the pieces that this rank gets.
  std::vector<OwnPiece> make(Ranks& ranks, const PieceMaker& maker, bool in_memory = false) {
    std::vector<OwnPiece> own;
    deal(ranks, maker.parts().count(), [&](std::uint64_t i) {
      const auto number = static_cast<std::uint32_t>(i + 1);
      if (in_memory) {  // and part of it in a file without a name
        auto piece = std::make_shared<BufferedPiece>(
            open_scratch_beside((folder_ / "scratch").string(), i % 2 << 22));
        maker.append(number, piece->writer(), no_progress());
        own.push_back({number, std::move(piece)});
      } else {
        maker.make(number, path_of(number), true, no_progress());
        own.push_back({number, open_piece_file(path_of(number))});
      }
    });
    return own;
  }

  /// Calls write(ranks, maker, pieces) on so many ranks, which have made pieces of a surface.
  template <class Write>
  void on_ranks(int ranks, const StoreReader& store, ExtractOptions options, std::uint32_t parts,
                bool in_memory, const Write& write) {
    options.threads = 1;
    run_on_threads(ranks, [&](Ranks& job) {
      const PieceMaker maker(store, options, share_plans(job, [&] {
                               return PieceMaker::plan(store, options, parts);
                             }));
      write(job, maker, make(job, maker, in_memory));
    });
  }
};

}  // namespace isobrick::test
