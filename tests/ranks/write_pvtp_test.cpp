#include "ranks/write_pvtp.h"

#include <filesystem>
#include <map>

#include "io/meshes/vtp_sink.h"
#include "tests/ranks/rank_pieces.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

/// Files by name.
using Files = std::map<std::string, std::string>;

class WritePvtp : public RankPieces {
 protected:
  static constexpr std::uint64_t kPartTriangles = 5000;

  /// A PVTP and its parts; the names of its parts begin with that of the file.
  Files files_of(const std::string& folder) {
    Files files;
    for (const auto& entry : fs::recursive_directory_iterator(folder_ / folder))
      if (entry.is_regular_file())
        files[fs::relative(entry.path(), folder_ / folder).string()] =
            content_of_piece(entry.path());
    return files;
  }

  fs::path output_in(const std::string& folder) {
    fs::remove_all(folder_ / folder);
    fs::create_directory(folder_ / folder);
    return folder_ / folder / "m.pvtp";
  }

  /// Those of one process.
  Files expected(const StoreReader& store, const ExtractOptions& options) {
    PvtpSink sink(output_in("one").string(), false, kPartTriangles);
    isobrick::extract(store, options, sink);
    return files_of("one");
  }

  Files of_ranks(int ranks, const StoreReader& store, const ExtractOptions& options,
                 std::uint32_t parts, bool in_memory,
                 std::uint64_t max_narrow_vertices = kMaxNarrowVertices) {
    const fs::path path = output_in("ranks");
    on_ranks(ranks, store, options, parts, in_memory,
             [&](Ranks& job, const PieceMaker& maker, std::vector<OwnPiece> pieces) {
               write_pvtp(job, maker.parts(), std::move(pieces), maker.header(), path, false,
                          no_progress(), {kPartTriangles, max_narrow_vertices});
             });
    return files_of("ranks");
  }
};

TEST_F(WritePvtp, MakesTheFilesOfOneProcess) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 110}));
  for (const ExtractOptions& options :
       {ExtractOptions{.isovalue = 50, .normals = true, .drop_degenerate = true},
        ExtractOptions{.isovalue = 49.5, .topology = Topology::trilinear, .cap = true}}) {
    const Files whole = expected(reader, options);
    ASSERT_GT(whole.size(), 20u);
    for (const int ranks : {1, 2, 5})
      for (const std::uint32_t parts : {1u, 7u, 40u})
        EXPECT_TRUE(of_ranks(ranks, reader, options, parts, parts == 7) == whole)
            << ranks << " ranks, " << parts << " parts";
  }
}

TEST_F(WritePvtp, NumbersOf64BitsMakeTheSameFiles) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 110}));
  const ExtractOptions options{.isovalue = 50, .normals = true};
  EXPECT_TRUE(of_ranks(2, reader, options, 7, false, 1000) == expected(reader, options));
}

TEST_F(WritePvtp, MakesAFileWithoutASurface) {
  const StoreReader reader = store(busy_field<std::uint8_t>({50, 40, 60}));
  const ExtractOptions options{.isovalue = 1000};
  const Files whole = expected(reader, options);
  EXPECT_EQ(whole.size(), 2u);
  EXPECT_TRUE(of_ranks(2, reader, options, 3, false) == whole);
}

TEST_F(WritePvtp, LeavesNothingOfADamagedPiece) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 60}));
  const fs::path path = output_in("ranks");
  on_ranks(1, reader, {.isovalue = 50}, 3, false,
           [&](Ranks& job, const PieceMaker& maker, const std::vector<OwnPiece>& pieces) {
             std::string bytes = content_of_piece(path_of(3));
             bytes[bytes.size() / 2] ^= 1;
             write_bytes(path_of(3), bytes);
             EXPECT_THROW(
                 write_pvtp(job, maker.parts(), pieces, maker.header(), path, true, no_progress()),
                 DamageError);
           });
  EXPECT_TRUE(files_of("ranks").empty());
}

}  // namespace
}  // namespace isobrick::test
