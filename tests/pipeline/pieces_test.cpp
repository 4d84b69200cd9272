#include <isobrick/pieces.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>

#include <isobrick/convert.h>
#include <isobrick/error.h>
#include <isobrick/index_build.h>
#include <isobrick/mesh_sinks.h>
#include "pipeline/pieces/piece_format.h"
#include "tests/pipeline/convert_doubles.h"
#include "tests/pipeline/least_budget.h"
#include "tests/surface/field.h"
#include "tests/temporary_folder.h"

// Parts of a mesh, made alone and put together: the mesh of a single extraction.

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;
using isobrick::testing::Field;

/// Keeps the mesh and what is known before it; may fail.
class PieceSink final : public MeshSink {
 public:
  Indexing indexing() const override { return Indexing::welded; }
  void begin(const MeshHeader& known) override { header = known; }
  void write(const MeshChunk& chunk) override {
    EXPECT_EQ(chunk.first_vertex, positions.size());
    largest_chunk = std::max<std::size_t>(
        largest_chunk,
        chunk.positions.size_bytes() + chunk.normals.size_bytes() + chunk.triangles.size_bytes());
    positions.insert(positions.end(), chunk.positions.begin(), chunk.positions.end());
    normals.insert(normals.end(), chunk.normals.begin(), chunk.normals.end());
    triangles.insert(triangles.end(), chunk.triangles.begin(), chunk.triangles.end());
  }
  void finish() override { finished = true; }
  std::uint64_t bytes() const override { return 0; }

  MeshHeader header;
  std::vector<Vec3f> positions, normals;
  std::vector<Triangle> triangles;
  std::size_t largest_chunk = 0;
  bool finished = false;
};

std::string bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void write_bytes(const fs::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

void expect_same(const PieceSink& a, const PieceSink& b) {
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.normals, b.normals);
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_EQ(a.header.has_normals, b.header.has_normals);
  EXPECT_EQ(a.header.world_lo, b.header.world_lo);
  EXPECT_EQ(a.header.world_hi, b.header.world_hi);
  EXPECT_EQ(a.header.unit, b.header.unit);
  ASSERT_EQ(a.header.surface.has_value(), b.header.surface.has_value());
  if (!a.header.surface) return;
  EXPECT_EQ(a.header.surface->lo, b.header.surface->lo);
  EXPECT_EQ(a.header.surface->hi, b.header.surface->hi);
}

/// Noise in one half and smooth waves in the other, with calm regions; many samples equal 50.
template <class T>
Field<T> busy_field(Int3 extent) {
  std::mt19937 random(5);
  return Field<T>(extent, [&](Int3 p) -> double {
    const auto noise = static_cast<double>(random() % 100);
    if (p.z > 70 && p.y < 40) return 0;
    if (p.x < 45) return std::floor(noise);
    return std::floor(50 + 45 * std::sin(static_cast<double>(p.x + 2 * p.y - p.z) / 11));
  });
}

class Pieces : public ::testing::Test {
 protected:
  template <class T>
  StoreReader store(const Field<T>& field, ConvertOptions options = {}) {
    MemorySource source(field.extent, scalar_type_of<T>, as_bytes(field.samples));
    source.mutable_info().transform.spacing = {0.5, 1, 2};
    source.mutable_info().transform.unit = "millimeter";
    const fs::path path = folder_ / ("s" + std::to_string(next_++) + ".zarr");
    convert(source, path, options);
    return StoreReader(path);
  }

  static PieceSink whole(const StoreReader& store, const ExtractOptions& options) {
    PieceSink sink;
    extract(store, options, sink);
    return sink;
  }

  /// The pieces of so many parts, in the order of their numbers.
  std::vector<fs::path> pieces(const StoreReader& store, const ExtractOptions& options,
                               std::uint32_t count, const std::string& name = "p") {
    std::vector<fs::path> paths;
    for (std::uint32_t i = 1; i <= count; ++i) {
      paths.push_back(folder_ / (name + std::to_string(i) + ".piece"));
      fs::remove(paths.back());
      EXPECT_FALSE(extract_piece(store, options, {i, count}, paths.back()).is_kept);
    }
    return paths;
  }

  static PieceSink merged(const std::vector<fs::path>& paths, const MergeOptions& options = {}) {
    PieceSink sink;
    merge_pieces(paths, sink, options);
    EXPECT_TRUE(sink.finished);
    return sink;
  }

  /// What refuses the pieces.
  template <class Failure>
  static std::string refusal(const std::vector<fs::path>& paths) {
    PieceSink sink;
    try {
      merge_pieces(paths, sink);
    } catch (const Failure& failure) {
      EXPECT_FALSE(sink.finished);
      EXPECT_EQ(std::string(failure.what()).find('\n'), std::string::npos);
      return failure.what();
    }
    ADD_FAILURE() << "merged";
    return {};
  }

  TemporaryFolder folder_;
  int next_ = 0;
};

struct Case {
  const char* name;
  ExtractOptions options;
};

std::vector<Case> cases(Int3 extent) {
  const Box3 roi{{5, 33, 7}, {extent.x - 3, extent.y, 75}};
  return {
      {"plain", {.isovalue = 49.5}},
      {"normals", {.isovalue = 50, .normals = true}},
      {"drop", {.isovalue = 50, .normals = true, .drop_degenerate = true}},
      {"trilinear", {.isovalue = 49.5, .normals = true, .topology = Topology::trilinear}},
      {"drop trilinear",
       {.isovalue = 50, .drop_degenerate = true, .topology = Topology::trilinear}},
      {"cap", {.isovalue = 49.5, .normals = true, .cap = true}},
      {"cap trilinear", {.isovalue = 50, .roi = roi, .topology = Topology::trilinear, .cap = true}},
      {"region", {.isovalue = 49.5, .roi = roi, .normals = true}},
      {"drop region", {.isovalue = 50, .roi = roi, .drop_degenerate = true}},
      {"below", {.isovalue = 50, .inside = Inside::below, .cap = true}},
      {"level", {.isovalue = 40.25, .level = 1, .normals = true}},
      {"nothing", {.isovalue = 1000}}};
}

TEST_F(Pieces, BecomeTheMeshOfASingleExtraction) {
  const auto field = busy_field<std::uint8_t>({130, 97, 110});
  for (const Index brick : {16, 64}) {
    const StoreReader reader = store(field, {.brick = brick, .shard = 64, .levels = 2});
    for (const Case& one : cases(field.extent)) {
      const PieceSink expected = whole(reader, one.options);
      for (const std::uint32_t count : {1u, 2u, 3u, 7u, 50u}) {
        SCOPED_TRACE(std::string(one.name) + ", " + std::to_string(count) + " parts");
        if (brick == 64 && count != 7) continue;
        expect_same(merged(pieces(reader, one.options, count)), expected);
      }
    }
  }
}

TEST_F(Pieces, BecomeTheMeshOfASingleExtractionWhereSamplesAreMissing) {
  auto field = busy_field<float>({130, 97, 110});
  std::mt19937 random(3);
  for (float& v : field.samples)
    if (random() % 500 == 0) v = std::numeric_limits<float>::quiet_NaN();
  const StoreReader reader = store(field, {.brick = 32, .shard = 64, .levels = 2});
  for (const Case& one : cases(field.extent)) {
    const PieceSink expected = whole(reader, one.options);
    for (const std::uint32_t count : {2u, 60u}) {
      SCOPED_TRACE(std::string(one.name) + ", " + std::to_string(count) + " parts");
      expect_same(merged(pieces(reader, one.options, count)), expected);
    }
  }
}

/// Also of several range chunks of 512 cells.
TEST_F(Pieces, OfThinAndWideVolumes) {
  for (const Int3 extent : {Int3{300, 2, 40}, Int3{1100, 40, 3}, Int3{34, 3, 1100},
                            Int3{530, 540, 35}, Int3{500, 180, 1}}) {
    const auto field = busy_field<std::uint16_t>(extent);
    const StoreReader reader = store(field);
    for (const bool drops : {false, true}) {
      const ExtractOptions options{.isovalue = 50, .drop_degenerate = drops};
      expect_same(merged(pieces(reader, options, 5)), whole(reader, options));
    }
  }
}

/// What parts hold is divided alike by all tasks, whatever they have.
TEST_F(Pieces, AreTheSameBytesForAllMeans) {
  const auto field = busy_field<std::uint8_t>({130, 97, 110});
  StoreReader reader = store(field, {.brick = 16, .shard = 64, .levels = 1});
  const fs::path path = folder_ / "s0.zarr";
  add_index(path, {.kind = IndexKind::octree});
  add_index(path, {.kind = IndexKind::interval, .leaf = 4});
  const StoreReader indexed(path);
  for (const bool drops : {false, true}) {
    ExtractOptions options{.isovalue = 50, .normals = true, .drop_degenerate = drops};
    options.threads = 2;
    const Part part{3, 7};
    const fs::path first = folder_ / "first.piece", other = folder_ / "other.piece";
    extract_piece(reader, options, part, first, true);
    const std::string expected = bytes_of(first);
    EXPECT_GT(expected.size(), 10000u);
    const auto expect_equal = [&](const StoreReader& of, const ExtractOptions& with) {
      fs::remove(other);
      extract_piece(of, with, part, other);
      EXPECT_TRUE(bytes_of(other) == expected);
    };
    ExtractOptions alone = options;
    alone.threads = 1;
    alone.memory = std::uint64_t{60} << 20;
    expect_equal(reader, alone);
    expect_equal(indexed, options);
    for (const IndexChoice choice :
         {IndexChoice{false, IndexKind::octree}, IndexChoice{false, IndexKind::interval}}) {
      ExtractOptions by_index = options;
      by_index.index = choice;
      expect_equal(indexed, by_index);
    }
    fs::remove(first);
  }
}

TEST_F(Pieces, AreBalanced) {
  const Field<float> field({200, 180, 160}, [](Int3 p) {
    return std::sin(static_cast<double>(p.x) / 5) * std::cos(static_cast<double>(p.y) / 5) +
           std::sin(static_cast<double>(p.y) / 5) * std::cos(static_cast<double>(p.z) / 5) +
           std::sin(static_cast<double>(p.z) / 5) * std::cos(static_cast<double>(p.x) / 5);
  });
  const StoreReader reader = store(field);
  const PieceSink all = whole(reader, {});
  for (const std::uint32_t count : {2u, 8u}) {
    const double share = static_cast<double>(all.triangles.size()) / count;
    for (std::uint32_t i = 1; i <= count; ++i) {
      const PieceReport report = extract_piece(reader, {}, {i, count}, folder_ / "one.piece", true);
      EXPECT_NEAR(static_cast<double>(report.surface.triangles), share, 0.25 * share);
    }
  }
}

TEST_F(Pieces, ComeInAnyOrder) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 60}));
  const ExtractOptions options{.isovalue = 50};
  std::vector<fs::path> paths = pieces(reader, options, 6);
  const PieceSink expected = whole(reader, options);
  std::mt19937 random(1);
  for (int i = 0; i < 5; ++i) {
    std::shuffle(paths.begin(), paths.end(), random);
    expect_same(merged(paths), expected);
  }
}

TEST_F(Pieces, MayBeMergedWithoutNormals) {
  const StoreReader reader = store(busy_field<std::uint8_t>({70, 97, 60}));
  ExtractOptions options{.isovalue = 50, .normals = true};
  const auto paths = pieces(reader, options, 3);
  options.normals = false;
  expect_same(merged(paths, {.normals = false}), whole(reader, options));
}

TEST_F(Pieces, AreKeptWhereTheyAreWhole) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 60}));
  ExtractOptions options{.isovalue = 50, .drop_degenerate = true};
  const fs::path path = folder_ / "a.piece";
  const PieceReport made = extract_piece(reader, options, {2, 3}, path);
  const std::string bytes = bytes_of(path);
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
  const std::string bytes = bytes_of(path);
  const auto expect_replaced = [&] {
    EXPECT_FALSE(extract_piece(reader, options, {2, 3}, path).is_kept);
    EXPECT_TRUE(bytes_of(path) == bytes);
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
  EXPECT_EQ(bytes_of(path), "what somebody wrote");
  EXPECT_FALSE(extract_piece(reader, {.isovalue = 50}, {1, 2}, path, true).is_kept);
  EXPECT_THROW(extract_piece(reader, {.isovalue = 50}, {1, 2}, folder_ / ""), UsageError);
  EXPECT_THROW(extract_piece(reader, {.isovalue = 50}, {0, 2}, path), UsageError);
  EXPECT_THROW(extract_piece(reader, {.isovalue = 50}, {3, 2}, path), UsageError);
  EXPECT_THROW(extract_piece(reader, {.isovalue = 50, .backend = Backend::cuda}, {1, 2}, path),
               UsageError);
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
  std::string future = bytes_of(good[2]);
  future[8] = 2;
  write_bytes(other, future);
  EXPECT_NE(replaced(other).find("version 2"), std::string::npos);
  EXPECT_THROW(read_pieces({}), UsageError);
  EXPECT_THROW(read_pieces(std::vector{folder_ / "no.piece"}), Error);
}

TEST_F(Pieces, ThatAreDamagedAreRefused) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 40}));
  const auto good = pieces(reader, {.isovalue = 50, .normals = true}, 3);
  const std::string bytes = bytes_of(good[1]);
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

TEST_F(Pieces, AreMergedWithinABudget) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 110}));
  const ExtractOptions options{.isovalue = 50};
  const auto paths = pieces(reader, options, 5);
  PieceSink sink;
  try {
    merge_pieces(paths, sink, {.memory = std::uint64_t{1} << 20});
    FAIL() << "merged in one MiB";
  } catch (const UsageError& refusal) {
    const std::uint64_t least = least_budget_in(refusal.what());
    EXPECT_GE(least, read_pieces(paths).merge_memory);
    const PieceSink small = merged(paths, {.memory = least});
    expect_same(small, whole(reader, options));
    EXPECT_LT(small.largest_chunk, std::size_t{2} << 20);
    EXPECT_THROW(merge_pieces(paths, sink, {.memory = read_pieces(paths).merge_memory - 1}),
                 UsageError);
  }
}

TEST_F(Pieces, CanBeCancelled) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 60}));
  const auto paths = pieces(reader, {.isovalue = 50}, 2);
  std::stop_source stop;
  stop.request_stop();
  PieceSink sink;
  EXPECT_THROW(merge_pieces(paths, sink, {.cancel = stop.get_token()}), Cancelled);
  EXPECT_FALSE(sink.finished);
}

TEST_F(Pieces, KnowWhatTheyBecome) {
  const StoreReader reader = store(busy_field<std::uint8_t>({130, 97, 60}));
  const ExtractOptions options{.isovalue = 50, .drop_degenerate = true};
  const auto paths = pieces(reader, options, 4);
  PieceSink sink;
  const ExtractReport expected = extract(reader, options, sink);
  const PiecesInfo info = read_pieces(paths);
  EXPECT_EQ(info.size.vertices, expected.vertices);
  EXPECT_EQ(info.size.triangles, expected.triangles);
  EXPECT_EQ(info.degenerate, expected.degenerate_triangles);
  EXPECT_EQ(info.isovalue, 50);
  std::uint64_t bytes = 0;
  for (const fs::path& path : paths) bytes += fs::file_size(path);
  EXPECT_EQ(info.bytes, bytes);
}

/// The format of the file is documented: docs/reference/piece_format.md.
TEST_F(Pieces, HaveTheDocumentedBytes) {
  const Field<std::uint8_t> field({3, 2, 2}, [](Int3 p) { return p.x == 0 ? 100 : 0; });
  const StoreReader reader = store(field);
  const fs::path path = folder_ / "a.piece";
  extract_piece(reader, {.isovalue = 50}, {1, 1}, path);
  const std::string bytes = bytes_of(path);
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
