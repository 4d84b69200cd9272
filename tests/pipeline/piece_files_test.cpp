#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include <isobrick/error.h>
#include "pipeline/pieces/piece_format.h"
#include "tests/pipeline/pieces_fixture.h"

// Pieces as files: which are kept, replaced and refused, and their bytes.

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;
using isobrick::testing::Field;

TEST_F(Pieces, AreKeptWhereTheyAreWhole) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 60}));
  ExtractOptions options{.isovalue = 50, .drop_degenerate = true};
  const fs::path path = folder_ / "a.piece";
  const PieceReport made = extract_piece(reader, options, {2, 3}, path);
  const std::string bytes = content_of_piece(path);
  EXPECT_EQ(made.bytes, bytes.size());
  const auto time = fs::last_write_time(path);
  options.threads = 1;
  const PieceReport kept = extract_piece(reader, options, {2, 3}, path, true);
  EXPECT_TRUE(kept.is_kept);
  EXPECT_EQ(fs::last_write_time(path), time);
  EXPECT_EQ(kept.bytes, made.bytes);
  EXPECT_EQ(kept.surface.vertices, made.surface.vertices);
  EXPECT_EQ(kept.surface.triangles, made.surface.triangles);
  EXPECT_EQ(kept.surface.degenerate_triangles, made.surface.degenerate_triangles);
  EXPECT_GT(kept.surface.degenerate_triangles, 0u);
}

TEST_F(Pieces, OfSomethingElseOrDamagedAreReplaced) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 60}));
  const ExtractOptions options{.isovalue = 50};
  const fs::path path = folder_ / "a.piece";
  extract_piece(reader, options, {2, 3}, path);
  const std::string bytes = content_of_piece(path);
  const auto expect_replaced = [&] {
    EXPECT_FALSE(extract_piece(reader, options, {2, 3}, path).is_kept);
    EXPECT_TRUE(content_of_piece(path) == bytes);
  };
  for (const std::size_t size : {std::size_t{0}, std::size_t{20}, bytes.size() - 1}) {
    write_bytes(path, bytes.substr(0, size));
    expect_replaced();
  }
  for (std::size_t at = 8; at < bytes.size(); at += 1 + bytes.size() / 40) {
    std::string changed = bytes;
    changed[at] = static_cast<char>(changed[at] ^ 4);
    write_bytes(path, changed);
    expect_replaced();
  }
  write_bytes(path, bytes + "x");
  expect_replaced();
  ExtractOptions other = options;
  other.isovalue = 51;
  extract_piece(reader, other, {2, 3}, path);
  expect_replaced();
  extract_piece(reader, options, {1, 3}, path);
  expect_replaced();
  const StoreReader of_others = store(busy_field<std::uint8_t>({130, 97, 61}));
  extract_piece(of_others, options, {2, 3}, path);
  expect_replaced();
}

/// Samples decide whether a piece is of a store, not where it lies.
TEST_F(Pieces, AreRecognisedByTheSamplesOfTheirStore) {
  const auto field = busy_field<std::uint8_t>({130, 97, 60});
  const StoreReader reader = store(field);
  const fs::path path = folder_ / "a.piece";
  extract_piece(reader, {.isovalue = 50}, {2, 3}, path);
  fs::copy(folder_ / "s0.zarr", folder_ / "copy.zarr", fs::copy_options::recursive);
  const StoreReader copy(folder_ / "copy.zarr");
  EXPECT_TRUE(extract_piece(copy, {.isovalue = 50}, {2, 3}, path).is_kept);
  auto changed = field;
  changed.at({64, 48, 30}) ^= 1;  // within the range of its block
  const StoreReader other = store(changed);
  EXPECT_FALSE(extract_piece(other, {.isovalue = 50}, {2, 3}, path).is_kept);
}

TEST_F(Pieces, ReplaceNoOtherFile) {
  const StoreReader reader = store(busy_field<std::uint8_t>({70, 50, 60}));
  const fs::path path = folder_ / "notes.piece";
  write_bytes(path, "what somebody wrote");
  EXPECT_THROW(extract_piece(reader, {.isovalue = 50}, {1, 2}, path), UsageError);
  EXPECT_EQ(content_of_piece(path), "what somebody wrote");
  EXPECT_FALSE(extract_piece(reader, {.isovalue = 50}, {1, 2}, path, true).is_kept);
  EXPECT_THROW(extract_piece(reader, {.isovalue = 50}, {1, 2}, folder_ / ""), UsageError);
  EXPECT_THROW(extract_piece(reader, {.isovalue = 50}, {0, 2}, path), UsageError);
  EXPECT_THROW(extract_piece(reader, {.isovalue = 50}, {3, 2}, path), UsageError);
}

/// Ends an extraction in its middle.
class EndingProgress final : public Progress {
 public:
  void begin(std::string_view, std::uint64_t) override {}
  void advance(std::uint64_t) override {
    if (++calls_ > 2) throw Error("ended");
  }
  void end() override {}

 private:
  int calls_ = 0;
};

TEST_F(Pieces, ThatEndInTheMiddleLeaveNothing) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 110}));
  EndingProgress ends;
  const fs::path path = folder_ / "parts";
  fs::create_directory(path);
  ExtractOptions options{.isovalue = 50};
  options.memory = std::uint64_t{60} << 20;
  options.threads = 1;
  EXPECT_THROW(extract_piece(reader, options, {1, 1}, path / "a.piece", false, ends), Error);
  EXPECT_TRUE(fs::is_empty(path));
}

TEST_F(Pieces, ThatAreNotAllOfOneMeshAreRefused) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 60}));
  const ExtractOptions options{.isovalue = 50};
  const auto good = pieces(reader, options, 4);
  const auto without = [&](std::size_t i) {
    auto some = good;
    some.erase(some.begin() + static_cast<std::ptrdiff_t>(i));
    return some;
  };
  EXPECT_NE(refusal<UsageError>(without(2)).find("part 3 of 4 is missing"), std::string::npos);
  auto two = without(2);
  two.erase(two.begin());
  EXPECT_NE(refusal<UsageError>(two).find("parts 1 and 3 of 4 are missing"), std::string::npos);
  auto twice = good;
  twice.push_back(good[1]);
  EXPECT_NE(refusal<UsageError>(twice).find("are both part 2 of 4"), std::string::npos);
  const auto replaced = [&](const fs::path& by) {
    auto some = good;
    some[2] = by;
    return refusal<UsageError>(some);
  };
  const fs::path other = folder_ / "other.piece";
  ExtractOptions different = options;
  different.isovalue = 51;
  extract_piece(reader, different, {3, 4}, other);
  EXPECT_NE(replaced(other).find("isovalue (50.0 and 51.0)"), std::string::npos);
  extract_piece(reader, options, {3, 5}, other);
  EXPECT_NE(replaced(other).find("number of parts (4 and 5)"), std::string::npos);
  const StoreReader changed = store(busy_field<std::uint8_t>({130, 97, 61}));
  extract_piece(changed, options, {3, 4}, other);
  EXPECT_NE(replaced(other).find("samples"), std::string::npos);
  write_bytes(other, "ply\nformat ascii 1.0\n");
  EXPECT_NE(replaced(other).find("is no piece"), std::string::npos);
  std::string future = content_of_piece(good[2]);
  future[8] = 2;
  write_bytes(other, future);
  EXPECT_NE(replaced(other).find("version 2"), std::string::npos);
  EXPECT_THROW(read_pieces({}), UsageError);
  EXPECT_THROW(read_pieces(std::vector{folder_ / "no.piece"}), Error);
}

TEST_F(Pieces, ThatAreDamagedAreRefused) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 40}));
  const auto good = pieces(reader, {.isovalue = 50, .normals = true}, 3);
  const std::string bytes = content_of_piece(good[1]);
  std::vector<fs::path> some = good;
  some[1] = folder_ / "damaged.piece";
  const auto expect_refused = [&](const std::string& changed) {
    write_bytes(some[1], changed);
    const std::string why = refusal<DamageError>(some);
    EXPECT_NE(why.find("damaged.piece"), std::string::npos) << why;
    EXPECT_NE(why.find("make it again"), std::string::npos) << why;
  };
  for (std::size_t at = 16; at < bytes.size(); at += 1 + bytes.size() / 60) {
    if (at > 16 && at < 1000) continue;  // the description: below
    std::string changed = bytes;
    changed[at] = static_cast<char>(changed[at] ^ 16);
    expect_refused(changed);
  }
  for (const std::size_t size :
       {std::size_t{0}, std::size_t{16}, std::size_t{500}, bytes.size() / 2, bytes.size() - 1})
    expect_refused(bytes.substr(0, size));
  // Whatever is wrong with the description, the checksum shows it at last.
  for (std::size_t at = 16; at < 1000; at += 7) {
    std::string changed = bytes;
    changed[at] = static_cast<char>(changed[at] ^ 1);
    write_bytes(some[1], changed);
    PieceSink sink;
    EXPECT_THROW(merge_pieces(some, sink), Error);
    EXPECT_FALSE(sink.finished);
  }
}

/// The format of the file is documented: docs/reference/piece_format.md.
TEST_F(Pieces, HaveTheDocumentedBytes) {
  const Field<std::uint8_t> field({3, 2, 2}, [](Int3 p) { return p.x == 0 ? 100 : 0; });
  const StoreReader reader = store(field);
  const fs::path path = folder_ / "a.piece";
  extract_piece(reader, {.isovalue = 50}, {1, 1}, path);
  const std::string bytes = content_of_piece(path);
  EXPECT_EQ(bytes.substr(0, 8), "isopiece");
  const auto number = [&](std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
  };
  EXPECT_EQ(number(8), 1u);
  const std::size_t header = number(12), tile = 16 + header + 8;
  EXPECT_EQ(nlohmann::json::parse(bytes.substr(16, header)).at("part"), (nlohmann::json{1, 1}));
  EXPECT_EQ(number(tile + 8), 4u);   // vertices
  EXPECT_EQ(number(tile + 12), 2u);  // triangles
  const std::size_t end = tile + 16 + 4 * 12 + 2 * 12;
  ASSERT_EQ(bytes.size(), end + 72);
  EXPECT_EQ(number(end), 0u);       // neighbours
  EXPECT_EQ(number(end + 8), 1u);   // tiles
  EXPECT_EQ(number(end + 16), 4u);  // vertices
  EXPECT_EQ(number(end + 24), 2u);  // triangles
  EXPECT_EQ(number(end + 48), bytes.size());
  EXPECT_EQ(bytes.substr(end + 56, 8), "pieceend");
}

}  // namespace
}  // namespace isobrick::test
