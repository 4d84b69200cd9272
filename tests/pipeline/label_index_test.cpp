#include <isobrick/label_index.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include <isobrick/error.h>
#include <isobrick/label_pieces.h>
#include <isobrick/recode.h>
#include <isobrick/verify.h>
#include "bricks/stored_index.h"
#include "pipeline/labels/label_list_search.h"
#include "tests/pipeline/labels_fixture.h"
#include "tests/pipeline/least_budget.h"

// Lists of labels in stores: what they are, and what an extraction reads by them.

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

std::string read_all(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

class LabelIndex : public Labels {
 protected:
  fs::path path_of_last() { return folder_ / ("s" + std::to_string(next_ - 1) + ".zarr"); }

  template <class T>
  StoreReader listed(const Field<T>& field, Index brick = 64,
                     const LabelIndexOptions& options = {}) {
    store(field, brick);
    add_label_index(path_of_last(), options);
    return StoreReader(path_of_last());
  }

  fs::path chunk_file(int level = 0) {
    return path_of_last() / "isobrick" / std::to_string(level) / "index" / "labels" / "c" / "0" /
           "0" / "0";
  }

  /// Both ways give the same meshes; by lists no more is read. Returns the bricks by lists and by
  /// ranges.
  std::pair<std::uint64_t, std::uint64_t> compare(const StoreReader& reader, LabelOptions options) {
    LabelReport by_lists, by_ranges;
    const Meshes expected = [&] {
      LabelOptions without = options;
      without.use_lists = false;
      return meshes_of(reader, without, &by_ranges);
    }();
    EXPECT_EQ(meshes_of(reader, options, &by_lists), expected);
    EXPECT_EQ(by_ranges.index_bytes, 0u);
    EXPECT_LE(by_lists.bricks_read, by_ranges.bricks_read);
    return {by_lists.bricks_read, by_ranges.bricks_read};
  }
};

/// Cells whose numbers say nothing of their places.
template <class T>
isobrick::testing::Field<T> shuffled_cells(Int3 extent, int count, T first = 0) {
  auto field = cells<T>(extent, count, 11);
  std::vector<T> numbers;
  for (int i = 0; i <= count; ++i) numbers.push_back(static_cast<T>(first + static_cast<T>(i)));
  std::mt19937 random(3);
  std::shuffle(numbers.begin() + 1, numbers.end(), random);
  for (T& sample : field.samples) sample = numbers[static_cast<std::size_t>(sample)];
  return field;
}

TEST_F(LabelIndex, ListsHaveTheLabelsOfTheirTiles) {
  for (const Int3 extent : {Int3{150, 97, 75}, Int3{65, 64, 33}, Int3{40, 40, 40}}) {
    const auto field = shuffled_cells<std::uint16_t>(extent, 200);
    const StoreReader reader = listed(field, 16);
    for (const std::int64_t label : {0, 7, 99, 200}) {
      const LabelSelection selection({{label, label}}, 0);
      LabelListSearch search(reader, 0, selection);
      const ListedTiles found = search.find({0, 0, 0});
      const Int3 tiles =
          field.extent.x > 1 ? ceil_div(extent - Int3{1, 1, 1}, {32, 32, 32}) : extent;
      for_each_point({{0, 0, 0}, tiles}, [&](Int3 t) {
        bool expected = false;
        for_each_point(intersect({t * 32, t * 32 + Int3{33, 33, 33}}, field.box()),
                       [&](Int3 p) { expected |= field.at(p) == label; });
        EXPECT_EQ(found.may_have(t), expected) << label;
      });
    }
  }
}

TEST_F(LabelIndex, MeshesAreTheSameFromFewerBricks) {
  const auto field = shuffled_cells<std::uint16_t>({150, 140, 130}, 300);
  for (const Index brick : {16, 32, 64}) {
    const StoreReader reader = listed(field, brick);
    for (const LabelOptions& options :
         {LabelOptions{.labels = {{150, 150}}}, LabelOptions{.labels = {{150, 150}, {20, 22}}},
          LabelOptions{.labels = {{150, 150}}, .smooth = 6}, LabelOptions{.labels = {{0, 0}}},
          LabelOptions{.labels = {{100, 200}}, .level = 1},
          LabelOptions{.labels = {{100, 200}}, .roi = Box3{{31, 3, 64}, {97, 129, 128}}},
          LabelOptions{.labels = {{-5, 1000}}}}) {
      const auto [by_lists, by_ranges] = compare(reader, options);
      const bool is_small = options.labels.front().first == 150 && options.smooth == 0;
      EXPECT_LT(by_lists, brick == 16 && is_small ? by_ranges / 2 : by_ranges + 1);
    }
    // Of all labels ranges tell as much.
    LabelReport all;
    meshes_of(reader, {}, &all);
    EXPECT_EQ(all.index_bytes, 0u);
  }
}

TEST_F(LabelIndex, OneLabelTouchesItsBricksAndTheirNeighbours) {
  Field<std::uint8_t> field(Int3{256, 96, 96});
  for_each_point({{2, 2, 2}, {20, 20, 20}}, [&](Int3 p) { field.at(p) = 3; });
  for_each_point({{130, 40, 40}, {135, 45, 45}}, [&](Int3 p) { field.at(p) = 7; });
  for_each_point({{200, 70, 70}, {250, 90, 90}}, [&](Int3 p) { field.at(p) = 9; });
  const StoreReader reader = listed(field, 32);
  const auto [by_lists, by_ranges] = compare(reader, {.labels = {{7, 7}}});
  // The tile, and the layer of samples around it.
  EXPECT_LE(by_lists, 27u);
  EXPECT_GT(by_ranges, by_lists);
  LabelReport report;
  meshes_of(reader, {.labels = {{7, 7}}}, &report);
  EXPECT_GT(report.index_bytes, 0u);
}

TEST_F(LabelIndex, EverySampleTypeAndThinVolumes) {
  const Int3 extent{70, 65, 40};
  compare(listed(shuffled_cells<std::uint8_t>(extent, 60)), {.labels = {{9, 9}}});
  compare(listed(shuffled_cells<std::int8_t>(extent, 60, -30)), {.labels = {{-9, -9}}});
  compare(listed(shuffled_cells<std::int16_t>(extent, 60, -30)), {.labels = {{-9, -9}, {3, 3}}});
  compare(listed(shuffled_cells<std::int32_t>(extent, 60, -2000000000)),
          {.labels = {{-1999999990, -1999999990}}});
  compare(listed(shuffled_cells<std::uint32_t>(extent, 60, 4000000000u)),
          {.labels = {{4000000010, 4000000010}}});
  compare(listed(shuffled_cells<float>(extent, 60)), {.labels = {{9, 9}}});
  auto doubles = shuffled_cells<double>(extent, 60, 9007199254740000.0);
  for_each_point({{0, 0, 0}, {30, 30, 30}}, [&](Int3 p) { doubles.at(p) = std::nan(""); });
  compare(listed(doubles), {.labels = {{9007199254740010, 9007199254740010}}});
  for (const Int3 thin : {Int3{1, 1, 1}, Int3{130, 1, 1}, Int3{1, 70, 65}, Int3{129, 65, 1},
                          Int3{65, 33, 2}, Int3{600, 40, 3}}) {
    const auto field = shuffled_cells<std::uint16_t>(thin, 12);
    for (const std::uint16_t label : {field.at({0, 0, 0}), field.at(thin - Int3{1, 1, 1})})
      compare(listed(field), {.labels = {{label, label}}});
  }
}

TEST_F(LabelIndex, ManyLabelsInATileAreAnyLabel) {
  std::mt19937 random(2);
  Field<std::uint16_t> field(Int3{70, 40, 40}, [&](Int3 p) {
    return p.x < 35 ? static_cast<double>(random() % 60000) : 60001.0;
  });
  field.at({66, 20, 20}) = 60002;
  const StoreReader reader = listed(field, 16);
  const std::uint16_t somewhere = field.at({3, 3, 3});
  compare(reader, {.labels = {{somewhere, somewhere}}});
  compare(reader, {.labels = {{60002, 60002}}});
  EXPECT_EQ(verify(path_of_last(), {}).damage_count, 0u);
}

TEST_F(LabelIndex, BytesDependOnTheSamplesAlone) {
  const auto field = shuffled_cells<std::uint16_t>({150, 140, 130}, 300);
  listed(field, 16, {.threads = 4});
  const std::string expected = read_all(chunk_file());
  ASSERT_GT(expected.size(), 1000u);
  std::uint64_t least = 0;
  try {
    add_label_index(path_of_last(), {.memory = 1, .threads = 1, .force = true});
    FAIL() << "built in a byte";
  } catch (const UsageError& e) {
    least = least_budget_in(e.what());
  }
  EXPECT_TRUE(read_all(chunk_file()) == expected);
  add_label_index(path_of_last(), {.memory = least, .threads = 1, .force = true});
  EXPECT_TRUE(read_all(chunk_file()) == expected);
  // Parts of a chunk's index bricks do not depend on the store's bricks, its ranges' checksum does.
  EXPECT_EQ(verify(path_of_last(), {}).damage_count, 0u);
}

TEST_F(LabelIndex, IsMadeOnceUnlessItIsForced) {
  const auto field = shuffled_cells<std::uint16_t>({70, 60, 50}, 30);
  listed(field);
  EXPECT_THROW(add_label_index(path_of_last(), {}), UsageError);
  const IndexReport kept = add_label_index(path_of_last(), {.resume = true});
  EXPECT_EQ(kept.chunks, kept.chunks_kept);
  EXPECT_EQ(add_label_index(path_of_last(), {.force = true}).chunks_kept, 0u);
  EXPECT_EQ(stored_index_kinds(StoreReader(path_of_last()), 0), std::vector<std::string>{"labels"});
  // Beside one of ranges.
  add_index(path_of_last(), {});
  EXPECT_EQ(stored_index_kinds(StoreReader(path_of_last()), 0).size(), 2u);
  compare(StoreReader(path_of_last()), {.labels = {{7, 7}}});
}

TEST_F(LabelIndex, IsAddedByAConversion) {
  const auto field = shuffled_cells<std::uint16_t>({70, 60, 50}, 30);
  listed(field);
  const std::string expected = read_all(chunk_file());
  MemorySource source(field.extent, ScalarType::u16, as_bytes(field.samples));
  const fs::path path = folder_ / "converted.zarr";
  const ConvertReport report =
      convert(source, path, {.brick = 64, .downsampling = Downsampling::mode, .label_lists = true});
  EXPECT_GT(report.index_bytes, 0u);
  EXPECT_TRUE(read_all(path / "isobrick/0/index/labels/c/0/0/0") == expected);
}

TEST_F(LabelIndex, IsCopiedByRecode) {
  const auto field = shuffled_cells<std::uint16_t>({70, 60, 50}, 30);
  listed(field);
  const fs::path copy = folder_ / "copy.zarr";
  recode(StoreReader(path_of_last()), copy, {.codec = BrickCodec::none});
  EXPECT_TRUE(read_all(copy / "isobrick/0/index/labels/c/0/0/0") == read_all(chunk_file()));
  const StoreReader reader(copy);
  LabelReport report;
  meshes_of(reader, {.labels = {{7, 7}}}, &report);
  EXPECT_GT(report.index_bytes, 0u);
  EXPECT_EQ(verify(copy, {}).damage_count, 0u);
}

TEST_F(LabelIndex, DamageIsFound) {
  const auto field = shuffled_cells<std::uint16_t>({150, 140, 130}, 300);
  listed(field, 64);
  const std::string good = read_all(chunk_file());
  const auto put = [&](const std::string& bytes) {
    std::ofstream(chunk_file(), std::ios::binary) << bytes;
  };
  for (std::size_t at = 0; at < good.size(); at += 1 + good.size() / 40) {
    std::string changed = good;
    changed[at] = static_cast<char>(changed[at] ^ 8);
    put(changed);
    EXPECT_GT(verify(path_of_last(), {}).damage_count, 0u) << at;
  }
  // The directory is the last part, before the places of all parts and their checksum.
  const std::size_t places = 16 * std::size_t{1 + 3 * 3 * 3} + 4;
  std::string changed = good;
  char& in_directory = changed[changed.size() - places - 8];
  in_directory = static_cast<char>(in_directory ^ 8);
  put(changed);
  EXPECT_THROW(meshes_of(StoreReader(path_of_last()), {.labels = {{7, 7}}}), DamageError);
  EXPECT_NO_THROW(meshes_of(StoreReader(path_of_last()), {.labels = {{7, 7}}, .use_lists = false}));
  put(good.substr(0, good.size() / 2));
  EXPECT_THROW(meshes_of(StoreReader(path_of_last()), {.labels = {{7, 7}}}), DamageError);
  put(good);
  EXPECT_EQ(verify(path_of_last(), {}).damage_count, 0u);
  // Lists of other samples.
  auto other = field;
  other.at({5, 5, 5}) = 60000;
  const fs::path from = path_of_last();
  listed(other, 64);
  fs::remove_all(path_of_last() / "isobrick/0/index");
  fs::copy(from / "isobrick/0/index", path_of_last() / "isobrick/0/index",
           fs::copy_options::recursive);
  EXPECT_THROW(meshes_of(StoreReader(path_of_last()), {.labels = {{7, 7}}}), DamageError);
}

TEST_F(LabelIndex, PiecesAreTheSameWithAndWithoutLists) {
  const auto field = shuffled_cells<std::uint16_t>({150, 140, 130}, 300);
  const StoreReader reader = listed(field, 32);
  for (std::uint32_t i = 1; i <= 3; ++i) {
    const LabelPieceReport with =
        extract_label_piece(reader, {.labels = {{150, 153}}}, {i, 3}, folder_ / "a.piece", true);
    const LabelPieceReport without = extract_label_piece(
        reader, {.labels = {{150, 153}}, .use_lists = false}, {i, 3}, folder_ / "b.piece", true);
    EXPECT_TRUE(read_all(folder_ / "a.piece") == read_all(folder_ / "b.piece"));
    EXPECT_LE(with.pass.bricks_read, without.pass.bricks_read);
  }
}

TEST_F(LabelIndex, OfSamplesThatAreNoLabelsIsRefused) {
  Field<float> field(Int3{10, 10, 10});
  field.at({4, 4, 4}) = 2.5f;
  store(field);
  EXPECT_THROW(add_label_index(path_of_last(), {}), Error);
  EXPECT_TRUE(stored_index_kinds(StoreReader(path_of_last()), 0).empty());
}

}  // namespace
}  // namespace isobrick::test
