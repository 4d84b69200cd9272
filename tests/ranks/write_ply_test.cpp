#include <atomic>

#include <isobrick/mesh_file_sink.h>
#include "pipeline/pieces/piece_reader.h"
#include "ranks/write_ply.h"
#include "tests/ranks/rank_pieces.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class WritePly : public RankPieces {
 protected:
  /// The file of one process.
  std::string expected(const StoreReader& store, const ExtractOptions& options) {
    const fs::path path = folder_ / "one.ply";
    fs::remove(path);
    const auto sink = create_mesh_file(path, {});
    extract(store, options, *sink);
    return content_of_piece(path);
  }

  /// Of three parts.
  static PieceMaker maker_of(const StoreReader& store, double isovalue) {
    const ExtractOptions options{.isovalue = isovalue};
    return {store, options, PieceMaker::plan(store, options, 3)};
  }

  /// That of so many ranks.
  std::string of_ranks(int ranks, const StoreReader& store, ExtractOptions options,
                       std::uint32_t parts, bool in_memory = false) {
    const fs::path path = folder_ / "ranks.ply";
    on_ranks(ranks, store, std::move(options), parts, in_memory,
             [&](Ranks& job, const PieceMaker& maker, std::vector<OwnPiece> pieces) {
               write_ply(job, maker.parts(), std::move(pieces), maker.header(), path, true,
                         no_progress());
             });
    return content_of_piece(path);
  }
};

TEST_F(WritePly, MakesTheFileOfOneProcess) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 110}));
  for (const ExtractOptions& options :
       {ExtractOptions{.isovalue = 50},
        ExtractOptions{.isovalue = 50, .normals = true, .drop_degenerate = true},
        ExtractOptions{.isovalue = 49.5, .topology = Topology::trilinear, .cap = true}}) {
    const std::string whole = expected(reader, options);
    ASSERT_GT(whole.size(), 100'000u);
    for (const int ranks : {1, 2, 5})
      for (const std::uint32_t parts : {1u, 7u, 40u})
        for (const bool in_memory : {false, true})
          EXPECT_TRUE(of_ranks(ranks, reader, options, parts, in_memory) == whole)
              << ranks << " ranks, " << parts << " parts";
  }
}

TEST_F(WritePly, MakesAFileWithoutASurface) {
  const StoreReader reader = store(busy_field<std::uint8_t>({50, 40, 60}));
  const ExtractOptions options{.isovalue = 1000};
  EXPECT_TRUE(of_ranks(2, reader, options, 3) == expected(reader, options));
}

/// What ranks learn of each other is the sizes of all pieces, and tiles beside their own.
TEST_F(WritePly, ExchangesBordersOnly) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 110}));
  const ExtractOptions options{.isovalue = 50, .threads = 1};
  constexpr std::uint32_t kParts = 12;
  std::atomic<std::uint64_t> received = 0, bound = 0;
  run_on_threads(4, [&](Ranks& job) {
    const PieceMaker maker(reader, options, PieceMaker::plan(reader, options, kParts));
    const std::vector<OwnPiece> own = make(job, maker);
    const std::uint64_t before = job.bytes_received();
    find_places(job, maker.parts(), own);
    received += job.bytes_received() - before;
    // Of each piece three numbers to three ranks; of each tile a question and an answer.
    for (const OwnPiece& piece : own)
      bound += std::uint64_t{3} * 24 + 24 * PieceReader(piece.bytes).neighbours().size();
  });
  EXPECT_GT(received, std::uint64_t{3} * 24 * kParts);
  EXPECT_LE(received, bound);
}

TEST_F(WritePly, RefusesPiecesThatDoNotFit) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 60}));
  const StoreReader other = store(busy_field<std::uint16_t>({130, 97, 80}));
  const fs::path path = folder_ / "ranks.ply";
  run_on_threads(1, [&](Ranks& job) {
    const PieceMaker maker = maker_of(reader, 50);
    const PieceMaker stranger = maker_of(other, 60);
    std::vector<OwnPiece> own = make(job, maker);
    stranger.make(2, path_of(2), true, no_progress());
    own[1].bytes = open_piece_file(path_of(2));
    try {
      write_ply(job, maker.parts(), own, maker.header(), path, true, no_progress());
      FAIL() << "written";
    } catch (const DamageError& error) {
      EXPECT_NE(std::string(error.what()).find("does not fit"), std::string::npos) << error.what();
    }
  });
  EXPECT_FALSE(fs::exists(path));
}

TEST_F(WritePly, LeavesNothingOfADamagedPiece) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 60}));
  const fs::path path = folder_ / "ranks.ply";
  run_on_threads(1, [&](Ranks& job) {
    const PieceMaker maker = maker_of(reader, 50);
    const std::vector<OwnPiece> own = make(job, maker);
    std::string bytes = content_of_piece(path_of(3));
    bytes[bytes.size() / 2] ^= 1;
    write_bytes(path_of(3), bytes);
    EXPECT_THROW(write_ply(job, maker.parts(), own, maker.header(), path, true, no_progress()),
                 DamageError);
  });
  for (const auto& entry : fs::directory_iterator(folder_ / ""))
    EXPECT_NE(entry.path().string().find(".piece") != std::string::npos ||
                  entry.path().extension() == ".zarr",
              false)
        << entry.path();
}

TEST(Deal, GivesEachNumberToOneRank) {
  std::vector<std::atomic<int>> given(100);
  run_on_threads(4, [&](Ranks& ranks) {
    deal(ranks, 60, [&](std::uint64_t i) { ++given[i]; });
    deal(ranks, 40, [&](std::uint64_t i) { ++given[60 + i]; });
  });
  for (const auto& times : given) EXPECT_EQ(times, 1);
}

TEST(LaunchedRanks, AreThoseOfTheLauncher) {
  for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_RANK", "SLURM_NTASKS"})
    ::unsetenv(name);
  EXPECT_EQ(launched_ranks(), 0);
  ::setenv("OMPI_COMM_WORLD_SIZE", "4", 1);
  EXPECT_EQ(launched_ranks(), 4);
  ::unsetenv("OMPI_COMM_WORLD_SIZE");
  ::setenv("SLURM_NTASKS", "3", 1);  // tasks of their own
  EXPECT_EQ(launched_ranks(), 0);
  ::setenv("PMIX_RANK", "0", 1);
  EXPECT_EQ(launched_ranks(), 3);
  ::unsetenv("PMIX_RANK");
  ::unsetenv("SLURM_NTASKS");
  ::setenv("PMI_SIZE", "2", 1);
  EXPECT_EQ(launched_ranks(), 2);
  ::unsetenv("PMI_SIZE");
}

}  // namespace
}  // namespace isobrick::test
