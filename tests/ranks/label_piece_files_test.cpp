#include "ranks/label_piece_files.h"

#include <isobrick/error.h>
#include "pipeline/labels/label_piece_maker.h"
#include "ranks/thread_ranks.h"
#include "tests/pipeline/labels_fixture.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class LabelRanks : public Labels {
 protected:
  /// The meshes from pieces that so many ranks made, and how many pieces were kept.
  std::pair<Meshes, std::uint64_t> of_ranks(int ranks, const StoreReader& reader,
                                            LabelOptions options, std::uint32_t parts) {
    options.threads = 1;
    const fs::path folder = folder_ / "pieces";
    fs::create_directories(folder);
    LabelPieceFiles made;
    run_on_threads(ranks, [&](Ranks& job) {
      LabelPieceFiles files = make_label_pieces(
          &job, reader, options, [&] { return LabelPieceMaker::plan(reader, options, parts); },
          folder, no_progress());
      EXPECT_EQ(files.paths.size(), parts);
      if (job.rank() == 0) made = std::move(files);
    });
    EXPECT_EQ(made.pass.bytes_read > 0, made.kept < parts);
    return {collect([&](const LabelVisitor& visit) {
              return merge_label_pieces(made.paths, {.threads = 2}, visit);
            }),
            made.kept};
  }
};

TEST_F(LabelRanks, MakeTheMeshesOfOneProcess) {
  const StoreReader reader = store(cells<std::uint16_t>({130, 97, 75}, 60, 21), 16);
  for (const LabelOptions& options :
       {LabelOptions{}, LabelOptions{.labels = {{0, 9}}, .smooth = 2}})
    for (const int ranks : {1, 2, 5})
      for (const std::uint32_t parts : {1u, 3u, 7u}) {
        fs::remove_all(folder_ / "pieces");
        EXPECT_EQ(of_ranks(ranks, reader, options, parts).first, meshes_of(reader, options))
            << ranks << " ranks, " << parts << " parts";
      }
}

TEST_F(LabelRanks, GoOnWithThePiecesThatAreWhole) {
  const StoreReader reader = store(cells<std::uint16_t>({130, 97, 75}, 60, 21), 16);
  of_ranks(3, reader, {}, 7);
  fs::remove(folder_ / "pieces" / "3of7.piece");
  fs::resize_file(folder_ / "pieces" / "5of7.piece", 1000);
  const auto [meshes, kept] = of_ranks(2, reader, {}, 7);
  EXPECT_EQ(kept, 5u);
  EXPECT_EQ(meshes, meshes_of(reader));
}

TEST_F(LabelRanks, AFailureIsThrown) {
  const StoreReader reader = store(cells<std::uint16_t>({40, 40, 40}, 9, 2), 16);
  EXPECT_THROW(of_ranks(3, reader, {.smooth = 9}, 3), UsageError);
}

}  // namespace
}  // namespace isobrick::test
