#include <isobrick/label_pieces.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>

#include <isobrick/error.h>
#include <isobrick/pieces.h>
#include "core/morton.h"
#include "io/bytes/output_file.h"
#include "pipeline/labels/label_piece_file.h"
#include "pipeline/labels/label_spool.h"
#include "tests/pipeline/labels_fixture.h"
#include "tests/pipeline/least_budget.h"

// Meshes of labels from pieces of parts.

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;
using Paths = std::vector<fs::path>;

std::string bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void put_bytes(const fs::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

class LabelPieces : public Labels {
 protected:
  /// The pieces of so many parts.
  Paths pieces_of(const StoreReader& store, const LabelOptions& options, std::uint32_t count,
                  const std::string& name = "p") {
    Paths paths;
    for (std::uint32_t i = 1; i <= count; ++i) {
      paths.push_back(folder_ / (name + std::to_string(i) + ".piece"));
      fs::remove(paths.back());
      EXPECT_FALSE(extract_label_piece(store, options, {i, count}, paths.back()).is_kept);
    }
    return paths;
  }

  static Meshes merged(const Paths& paths, const LabelMergeOptions& options = {}) {
    return collect(
        [&](const LabelVisitor& visit) { return merge_label_pieces(paths, options, visit); });
  }

  template <class Failure>
  static std::string refusal(const Paths& paths, const LabelMergeOptions& options = {}) {
    bool is_visited = false;
    try {
      merge_label_pieces(paths, options, [&](const LabelMesh&) { is_visited = true; });
    } catch (const Failure& failure) {
      EXPECT_FALSE(is_visited);
      EXPECT_EQ(std::string(failure.what()).find('\n'), std::string::npos);
      return failure.what();
    }
    ADD_FAILURE() << "merged";
    return {};
  }
};

/// Brick sizes, threads and the number of parts.
struct PartsCase {
  Index brick;
  int threads;
  std::uint32_t parts;
};

class LabelParts : public LabelPieces, public ::testing::WithParamInterface<PartsCase> {};

TEST_P(LabelParts, BecomeTheMeshesOfOnePass) {
  const auto field = cells<std::uint16_t>({130, 97, 75}, 60, 21);
  const auto [brick, threads, parts] = GetParam();
  Transform transform;
  transform.spacing = {0.5, 1, 2};
  const StoreReader reader = store(field, brick, transform);
  for (const LabelOptions& with :
       {LabelOptions{}, LabelOptions{.labels = {{0, 3}, {17, 17}}, .smooth = 2},
        LabelOptions{.roi = Box3{{31, 3, 16}, {120, 64, 75}}}, LabelOptions{.level = 1},
        LabelOptions{.background = 7, .smooth = 6, .pass_band = 0.3}}) {
    LabelOptions options = with;
    options.threads = threads;
    LabelReport whole;
    const Meshes expected = meshes_of(reader, options, &whole);
    ASSERT_GT(expected.size(), 3u);
    const Paths paths = pieces_of(reader, options, parts);
    EXPECT_EQ(merged(paths, {.threads = threads}), expected);
    const LabelPiecesInfo info = read_label_pieces(paths);
    EXPECT_EQ(info.size.vertices, whole.vertices);
    EXPECT_EQ(info.size.triangles, whole.triangles);
    EXPECT_EQ(info.level, options.level);
    EXPECT_EQ(info.name, reader.info().name);
  }
}

INSTANTIATE_TEST_SUITE_P(All, LabelParts,
                         ::testing::Values(PartsCase{64, 3, 1}, PartsCase{16, 2, 3},
                                           PartsCase{32, 1, 7}, PartsCase{64, 4, 40}));

TEST_F(LabelPieces, OfThinAndWideVolumes) {
  for (const Int3 extent : {Int3{300, 2, 40}, Int3{1100, 40, 3}, Int3{530, 540, 1}}) {
    const StoreReader reader = store(cells<std::uint8_t>(extent, 30, 5));
    EXPECT_EQ(merged(pieces_of(reader, {}, 5)), meshes_of(reader));
  }
}

TEST_F(LabelPieces, TellWhatTheMeshesAreInTheirOrder) {
  const StoreReader reader = store(cells<std::uint8_t>({70, 60, 50}, 20, 3));
  Paths paths = pieces_of(reader, {.labels = {{3, 9}}}, 4);
  std::reverse(paths.begin(), paths.end());
  std::vector<MeshBounds> bounds[2];
  const auto keep = [&](std::size_t i) {
    return [&bounds, i](const LabelMesh& mesh) {
      class HeaderSink final : public MeshSink {
       public:
        Indexing indexing() const override { return Indexing::welded; }
        void begin(const MeshHeader& known) override { header = known; }
        void write(const MeshChunk&) override {}
        void finish() override {}
        std::uint64_t bytes() const override { return 0; }
        MeshHeader header;
      } sink;
      mesh.write(sink);
      bounds[i].push_back({sink.header.world_lo, sink.header.world_hi});
      bounds[i].push_back(*sink.header.surface);
    };
  };
  extract_labels(reader, {.labels = {{3, 9}}, .threads = 1}, keep(0));
  merge_label_pieces(paths, {.threads = 1}, keep(1));
  ASSERT_EQ(bounds[0].size(), 14u);
  ASSERT_EQ(bounds[1].size(), 14u);
  for (std::size_t i = 0; i < 14; ++i) {
    EXPECT_EQ(bounds[0][i].lo, bounds[1][i].lo);
    EXPECT_EQ(bounds[0][i].hi, bounds[1][i].hi);
  }
}

TEST_F(LabelPieces, AreTheSameBytesForAllMeans) {
  const auto field = cells<std::uint16_t>({130, 97, 75}, 60, 21);
  const StoreReader reader = store(field);
  LabelOptions options{.smooth = 1, .memory = std::uint64_t{1} << 30, .threads = 4};
  extract_label_piece(reader, options, {2, 3}, folder_ / "a.piece");
  options.threads = 1;
  options.memory = std::uint64_t{128} << 20;
  extract_label_piece(reader, options, {2, 3}, folder_ / "b.piece");
  const std::string bytes = bytes_of(folder_ / "a.piece");
  EXPECT_GT(bytes.size(), 100'000u);
  EXPECT_TRUE(bytes == bytes_of(folder_ / "b.piece"));
}

TEST_F(LabelPieces, AreBalancedAndTouchTheirBricksOnly) {
  const StoreReader reader = store(cells<std::uint16_t>({128, 128, 128}, 300, 2), 16);
  LabelReport all;
  meshes_of(reader, {}, &all);
  for (std::uint32_t i = 1; i <= 4; ++i) {
    const LabelPieceReport made =
        extract_label_piece(reader, {}, {i, 4}, folder_ / "one.piece", true);
    const double share = static_cast<double>(all.triangles) / 4;
    EXPECT_NEAR(static_cast<double>(made.pass.triangles), share, 0.3 * share);
    EXPECT_LT(made.pass.bricks_read, all.bricks_read / 2);
  }
}

TEST_F(LabelPieces, AreKeptWhereTheyAreWhole) {
  const StoreReader reader = store(cells<std::uint8_t>({70, 60, 50}, 20, 3));
  const fs::path path = folder_ / "a.piece";
  const LabelPieceReport made = extract_label_piece(reader, {}, {1, 2}, path);
  EXPECT_FALSE(made.is_kept);
  EXPECT_GT(made.pass.bytes_read, 0u);
  const std::string bytes = bytes_of(path);
  EXPECT_EQ(made.bytes, bytes.size());
  const auto time = fs::last_write_time(path);
  const LabelPieceReport kept = extract_label_piece(reader, {.threads = 1}, {1, 2}, path);
  EXPECT_TRUE(kept.is_kept);
  EXPECT_EQ(fs::last_write_time(path), time);
  EXPECT_EQ(kept.bytes, made.bytes);
  EXPECT_EQ(kept.pass.triangles, made.pass.triangles);
  EXPECT_EQ(kept.pass.vertices, made.pass.vertices);
  const auto expect_replaced = [&] {
    EXPECT_FALSE(extract_label_piece(reader, {}, {1, 2}, path).is_kept);
    EXPECT_TRUE(bytes_of(path) == bytes);
  };
  for (const std::size_t size : {std::size_t{0}, std::size_t{20}, bytes.size() - 1}) {
    put_bytes(path, bytes.substr(0, size));
    expect_replaced();
  }
  for (std::size_t at = 8; at < bytes.size(); at += 1 + bytes.size() / 40) {
    std::string changed = bytes;
    changed[at] = static_cast<char>(changed[at] ^ 4);
    put_bytes(path, changed);
    expect_replaced();
  }
  for (const LabelOptions& other :
       {LabelOptions{.smooth = 1}, LabelOptions{.labels = {{3, 3}}}, LabelOptions{.background = 3},
        LabelOptions{.roi = Box3{{0, 0, 0}, {70, 60, 49}}}}) {
    extract_label_piece(reader, other, {1, 2}, path);
    expect_replaced();
  }
  extract_label_piece(reader, {}, {2, 2}, path);
  expect_replaced();
  const StoreReader changed = store(cells<std::uint8_t>({70, 60, 50}, 20, 4));
  extract_label_piece(changed, {}, {1, 2}, path);
  expect_replaced();
  // Also a piece of a surface, but no file of anybody else.
  extract_piece(reader, {.isovalue = 3}, {1, 2}, path);
  expect_replaced();
  put_bytes(path, "what somebody wrote");
  EXPECT_THROW(extract_label_piece(reader, {}, {1, 2}, path), UsageError);
  EXPECT_EQ(bytes_of(path), "what somebody wrote");
  EXPECT_FALSE(extract_label_piece(reader, {}, {1, 2}, path, true).is_kept);
  EXPECT_THROW(extract_label_piece(reader, {}, {3, 2}, path), UsageError);
  EXPECT_THROW(extract_label_piece(reader, {}, {1, 2}, "-"), UsageError);
}

TEST_F(LabelPieces, ThatEndInTheMiddleLeaveNothing) {
  const StoreReader reader = store(cells<std::uint8_t>({130, 97, 110}, 40, 3));
  class Ending final : public Progress {
   public:
    void begin(std::string_view, std::uint64_t) override {}
    void advance(std::uint64_t) override {
      if (++calls > 5) throw Error("ended");
    }
    void end() override {}
    int calls = 0;
  } ends;
  fs::create_directory(folder_ / "parts");
  const fs::path path = folder_ / "parts" / "a.piece";
  EXPECT_THROW(extract_label_piece(reader, {.threads = 1}, {1, 1}, path, false, ends), Error);
  EXPECT_TRUE(fs::is_empty(folder_ / "parts"));
  EXPECT_FALSE(extract_label_piece(reader, {}, {1, 1}, path).is_kept);
  EXPECT_EQ(merged({path}), meshes_of(reader));
}

TEST_F(LabelPieces, ThatAreNotAllOfOneImageAreRefused) {
  const StoreReader reader = store(cells<std::uint8_t>({130, 97, 60}, 30, 3));
  const Paths good = pieces_of(reader, {}, 4);
  const auto without = [&](std::size_t i) {
    Paths some = good;
    some.erase(some.begin() + static_cast<std::ptrdiff_t>(i));
    return some;
  };
  const auto expect_in = [](const std::string& text, const char* part) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  expect_in(refusal<UsageError>(without(2)), "part 3 of 4 is missing");
  Paths twice = good;
  twice.push_back(good[1]);
  expect_in(refusal<UsageError>(twice), "are both part 2 of 4");
  const fs::path other = folder_ / "other.piece";
  const auto replaced = [&] {
    Paths some = good;
    some[2] = other;
    return refusal<UsageError>(some);
  };
  extract_label_piece(reader, {.smooth = 3}, {3, 4}, other);
  expect_in(replaced(), "smooth");
  extract_label_piece(reader, {.labels = {{1, 9}}}, {3, 4}, other);
  expect_in(replaced(), "labels");
  extract_label_piece(reader, {}, {3, 5}, other);
  expect_in(replaced(), "number of parts (4 and 5)");
  const StoreReader changed = store(cells<std::uint8_t>({130, 97, 60}, 30, 4));
  extract_label_piece(changed, {}, {3, 4}, other);
  expect_in(replaced(), "samples");
  extract_piece(reader, {.isovalue = 3}, {3, 4}, other);
  expect_in(replaced(), "is a piece of an isosurface, and not of labels");
  EXPECT_FALSE(is_label_piece(other));
  EXPECT_TRUE(is_label_piece(good[0]));
  put_bytes(other, "ply and more");
  expect_in(replaced(), "is no piece");
  EXPECT_FALSE(is_label_piece(other));
  std::string future = bytes_of(good[2]);
  future[8] = 2;
  put_bytes(other, future);
  expect_in(replaced(), "version 2");
  EXPECT_THROW(read_label_pieces({}), UsageError);
  EXPECT_THROW(read_label_pieces(Paths{folder_ / "no.piece"}), Error);
  // A label that was named is missed once all is there.
  const Paths missing = pieces_of(reader, {.labels = {{3, 3}, {99, 99}}}, 2);
  expect_in(refusal<UsageError>(missing), "has no label 99");
}

TEST_F(LabelPieces, ThatAreDamagedAreRefused) {
  const StoreReader reader = store(cells<std::uint8_t>({130, 97, 40}, 30, 3));
  const Paths good = pieces_of(reader, {.labels = {{1, 30}}}, 3);
  const std::string bytes = bytes_of(good[1]);
  Paths some = good;
  some[1] = folder_ / "damaged.piece";
  for (std::size_t at = 16; at < bytes.size(); at += 1 + bytes.size() / 150) {
    std::string changed = bytes;
    changed[at] = static_cast<char>(changed[at] ^ 16);
    put_bytes(some[1], changed);
    try {
      merge_label_pieces(some, {}, [](const LabelMesh&) { FAIL() << "a mesh of damaged pieces"; });
      FAIL() << "merged " << at;
    } catch (const Error&) {
    }
  }
  for (const std::size_t size :
       {std::size_t{0}, std::size_t{16}, bytes.size() / 2, bytes.size() - 1}) {
    put_bytes(some[1], bytes.substr(0, size));
    EXPECT_NE(refusal<DamageError>(some).find("make it again"), std::string::npos);
  }
}

/// What a piece of right checksums may hold that no extraction writes.
TEST_F(LabelPieces, OfImpossibleTilesAreRefused) {
  const StoreReader reader = store(cells<std::uint8_t>({70, 60, 50}, 5, 3));
  const fs::path path = folder_ / "a.piece";
  extract_label_piece(reader, {}, {1, 2}, path);
  const LabelPieceDescription description = LabelPieceReader(path).description();
  ASSERT_GT(description.tiles.end, 1u);
  extract_label_piece(reader, {}, {2, 2}, folder_ / "b.piece");
  const LabelVertex vertex{TileCells::at(5, 5, 5), {0.5f, 0.5f, 0.5f}};
  const ForeignVertex foreign{std::uint32_t{1} | std::uint32_t{TileCells::at(2, 5, 5)} << 3};
  const LabelQuad good{0, 0, 0, 0}, bad{0, 0, 1, 0};
  const auto packed = [&](Int3 tile, std::vector<ForeignVertex> of_others, const LabelQuad& quad) {
    const LabelPiece piece{3, {&vertex, 1}, of_others, {&quad, 1}};
    return LabelSpool::pack(tile, {&piece, 1});
  };
  const auto refused = [&](const std::vector<std::vector<std::byte>>& records) {
    fs::remove(path);
    OutputFile out(path.string(), true);
    LabelPieceWriter writer(out.writer(), description);
    for (const auto& record : records) writer.append(record);
    writer.finish();
    out.publish();
    EXPECT_THROW(merge_label_pieces(Paths{path, folder_ / "b.piece"}, {},
                                    [](const LabelMesh& mesh) {
                                      isobrick::Mesh made;
                                      MemorySink sink(made);
                                      mesh.write(sink);
                                    }),
                 DamageError);
  };
  refused({packed({0, 0, 0}, {}, bad)});
  refused({packed({0, 0, 0}, {}, {0, 0, ~std::uint32_t{0}, 0})});
  refused({packed({1, 0, 0}, {}, good), packed({0, 0, 0}, {}, good)});
  refused({packed(morton_decode(description.tiles.end), {}, good)});
  // A neighbour that is not there, one without such a cell, and one without so many sheets.
  refused({packed({0, 0, 0}, {foreign}, bad)});
  refused({packed({0, 0, 0}, {foreign}, bad), packed({1, 0, 0}, {}, good)});
  const LabelVertex first{TileCells::at(2, 5, 5), {}};
  const LabelPiece neighbour{3, {&first, 1}, {}, {&good, 1}};
  const ForeignVertex sheet{foreign.bits | std::uint32_t{8000} << 19};
  refused({packed({0, 0, 0}, {sheet}, bad), LabelSpool::pack({1, 0, 0}, {&neighbour, 1})});
}

TEST_F(LabelPieces, AreMergedWithinABudget) {
  const StoreReader reader = store(cells<std::uint16_t>({100, 90, 80}, 50, 3));
  const Paths paths = pieces_of(reader, {}, 5);
  const std::string refused = refusal<UsageError>(paths, {.memory = std::uint64_t{1} << 20});
  const std::uint64_t least = least_budget_in(refused);
  EXPECT_GE(least, read_label_pieces(paths).merge_memory);
  EXPECT_EQ(merged(paths, {.memory = least}), meshes_of(reader));
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW(merge_label_pieces(paths, {.cancel = stop.get_token()}, [](const LabelMesh&) {}),
               Cancelled);
}

/// The format of the file is documented: docs/reference/piece_format.md.
TEST_F(LabelPieces, HaveTheDocumentedBytes) {
  Field<std::uint8_t> field(Int3{4, 4, 4});
  field.at({1, 2, 3}) = 5;
  const StoreReader reader = store(field);
  const fs::path path = folder_ / "a.piece";
  extract_label_piece(reader, {}, {1, 1}, path);
  const std::string bytes = bytes_of(path);
  const auto number = [&](std::size_t at, std::size_t size) {
    std::uint64_t value = 0;
    std::memcpy(&value, bytes.data() + at, size);
    return value;
  };
  EXPECT_EQ(bytes.substr(0, 8), "isolabel");
  EXPECT_EQ(number(8, 4), 1u);
  const std::size_t record = 16 + number(12, 4);
  EXPECT_EQ(number(record, 8), 0u);       // tile
  EXPECT_EQ(number(record + 8, 8), 5u);   // label
  EXPECT_EQ(number(record + 16, 4), 8u);  // vertices
  EXPECT_EQ(number(record + 20, 4), 0u);  // foreign
  EXPECT_EQ(number(record + 24, 4), 6u);  // quads
  // The first vertex is of the cell one before the sample.
  EXPECT_EQ(number(record + 32, 4),
            std::uint64_t{(1 - 1 + 2) + 37 * ((2 - 1 + 2) + 37 * (3 - 1 + 2))});
  const std::size_t end = record + 32 + 8 * 16 + 6 * 16;
  ASSERT_EQ(bytes.size(), end + 72);
  EXPECT_EQ(number(end, 8), 0u);        // neighbours
  EXPECT_EQ(number(end + 8, 8), 1u);    // records
  EXPECT_EQ(number(end + 16, 8), 8u);   // vertices
  EXPECT_EQ(number(end + 24, 8), 12u);  // triangles
  EXPECT_EQ(number(end + 40, 8), std::uint64_t{32 + 8 * 16 + 6 * 16});
  EXPECT_EQ(number(end + 48, 8), bytes.size());
  EXPECT_EQ(bytes.substr(end + 56, 8), "pieceend");
}

}  // namespace
}  // namespace isobrick::test
