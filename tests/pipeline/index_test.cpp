#include <gtest/gtest.h>

#include <tuple>

#include "bricks/stored_index.h"
#include "index/span_index.h"
#include "tests/pipeline/index_fixture.h"
#include "tests/pipeline/least_budget.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

/// Two axes have 16·k + 1 samples with odd k: blocks without cells inside of a tile.
constexpr Int3 kExtent{81, 49, 66};

template <class T>
std::vector<double> isovalues() {
  if constexpr (std::is_floating_point_v<T>)
    return {-700.25, 0, 1e-30, 1400};
  else if constexpr (sizeof(T) == 1)
    return {0, 0.5, 100, 255, 256};
  else
    return {-32768, -100.5, 1, 32767};
}

using Case = std::tuple<Index, ScalarType, Index>;

class IndexedMesh : public ::testing::TestWithParam<Case> {
 protected:
  TemporaryFolder folder_;
};

TEST_P(IndexedMesh, IsTheOneOfTheRanges) {
  const auto [leaf, type, brick] = GetParam();
  visit_scalar(type, [&, leaf = leaf, brick = brick](auto tag) {
    using T = typename decltype(tag)::type;
    MemorySource source = make_source<T>(kExtent, 3, true);
    const fs::path store = folder_ / "a";
    convert_quietly(source, store,
                    {.brick = brick,
                     .shard = 2 * brick,
                     .levels = 2,
                     .threads = 2,
                     .index = kStoredKinds[0],
                     .leaf = leaf});
    for (const IndexKind kind : kStoredKinds)
      if (kind != kStoredKinds[0]) add_index_quietly(store, {.kind = kind, .leaf = leaf});
    EXPECT_EQ(StoreReader(store).info().may_have_nan, is_floating(scalar_type_of<T>));
    std::vector<ExtractOptions> requests;
    for (const double iso : isovalues<T>()) {
      requests.push_back({.isovalue = iso});
      requests.push_back({.isovalue = iso, .roi = Box3{{3, 20, 30}, {80, 48, 66}}});
      requests.push_back({.isovalue = iso, .roi = Box3{{63, 0, 5}, {66, 49, 6}}});
      requests.push_back({.isovalue = iso, .level = 1});
    }
    for (const ExtractOptions& request : requests) {
      const std::string expected = mesh_of(store, request, std::nullopt);
      for (const IndexKind kind : kStoredKinds)
        EXPECT_TRUE(mesh_of(store, request, kind) == expected)
            << name_of(kind) << ", isovalue " << request.isovalue << ", level " << request.level;
    }
    const VerifyReport report = verify_quietly(store);
    EXPECT_EQ(report.damages, std::vector<std::string>{});
    EXPECT_EQ(report.indexes.size(), 2 * std::size(kStoredKinds));
  });
}

INSTANTIATE_TEST_SUITE_P(All, IndexedMesh,
                         ::testing::Combine(::testing::Values(1, 2, 4, 8, 16),
                                            ::testing::Values(ScalarType::u8, ScalarType::i16,
                                                              ScalarType::f32),
                                            ::testing::Values(16, 32, 64, 128)));

class Indexes : public ::testing::Test {
 protected:
  /// Some chunks along two axes, with a region of one value.
  void SetUp() override {
    std::vector<std::uint8_t> samples = make_samples<std::uint8_t>(extent_, 7);
    for_each_point({{300, 0, 0}, {700, extent_.y, extent_.z}}, [&](Int3 p) {
      samples[static_cast<std::size_t>(linear_index(p, extent_))] = 9;
    });
    MemorySource source(extent_, ScalarType::u8, as_bytes(samples));
    convert_quietly(source, store_, {.levels = 2});
  }

  /// How many bricks of an index have a part, in a level.
  std::size_t parts(IndexKind kind, int level) const {
    const StoreReader reader(store_);
    const StoredIndex index(reader, level, std::string(name_of(kind)));
    std::size_t count = 0;
    for_each_point({{0, 0, 0}, index.layout().chunks()}, [&](Int3 c) {
      const IndexChunk chunk = index.open(c);
      for (std::size_t part = 1; part < index.layout().parts_of_chunk(c); ++part)
        count += chunk.has(part);
    });
    return count;
  }

  Int3 extent_{1060, 523, 6};
  TemporaryFolder folder_;
  fs::path store_ = folder_ / "a";
};

TEST_F(Indexes, OfSeveralKindsLiveSideBySide) {
  const auto before = tree_of(store_);
  const std::string mesh = mesh_of(store_, {.isovalue = 77.5}, std::nullopt);
  for (const IndexKind kind : kStoredKinds) {
    const IndexReport report = add_index_quietly(store_, {.kind = kind, .leaf = 8});
    EXPECT_EQ(report.level_bytes.size(), 2u);
    EXPECT_EQ(report.chunks, 3u * 2 + 2);
    EXPECT_FALSE(report.ranges_added);
  }
  for (const IndexKind kind : kStoredKinds) {
    ExtractReport report;
    EXPECT_TRUE(mesh_of(store_, {.isovalue = 77.5}, kind, &report) == mesh);
    EXPECT_GT(report.search_bytes, 0u);
    EXPECT_GT(report.search_seconds, 0);
    // 17 × 9 × 1 index bricks; those wholly in the region have one value.
    EXPECT_EQ(parts(kind, 0), std::size_t{17 - 5} * 9);
  }
  EXPECT_EQ(stored_index_kinds(StoreReader(store_), 0),
            (std::vector<std::string>{"interval", "kdtree", "octree", "quadtree"}));
  // Nothing else has changed.
  for (const auto& [file, bytes] : before) EXPECT_TRUE(tree_of(store_).at(file) == bytes) << file;
  EXPECT_EQ(verify_quietly(store_).damage_count, 0u);
}

TEST_F(Indexes, AutoTakesTheFastestWhereLittleIsActive) {
  const auto automatic = [&](double iso) {
    const StoreReader store(store_);
    BytesSink sink;
    NoProgress silent;
    const ExtractReport report = extract(store, {.isovalue = iso, .threads = 2}, sink, silent);
    EXPECT_TRUE(sink.mesh() == mesh_of(store_, {.isovalue = iso}, std::nullopt));
    return report;
  };
  EXPECT_EQ(automatic(77.5).index, std::nullopt);
  add_index_quietly(store_, {.kind = IndexKind::quadtree, .leaf = 8});
  EXPECT_EQ(automatic(77.5).index, std::nullopt) << "finer leaves cost more";
  add_index_quietly(store_, {.kind = IndexKind::interval});
  EXPECT_EQ(automatic(77.5).index, IndexKind::interval);
  add_index_quietly(store_, {.kind = IndexKind::octree});
  const ExtractReport dense = automatic(77.5), empty = automatic(300);
  EXPECT_EQ(dense.index, IndexKind::octree);
  ExtractReport by_ranges;
  mesh_of(store_, {.isovalue = 77.5}, std::nullopt, &by_ranges);
  EXPECT_GT(dense.search_bytes, by_ranges.search_bytes);
  // Where nothing is active only directories are read.
  ExtractReport by_index;
  mesh_of(store_, {.isovalue = 300}, IndexKind::octree, &by_index);
  EXPECT_EQ(empty.search_bytes, by_index.search_bytes);
  mesh_of(store_, {.isovalue = 77.5}, IndexKind::octree, &by_index);
  EXPECT_LT(empty.search_bytes, by_index.search_bytes);
}

TEST_F(Indexes, BytesDependOnTheVolumeAlone) {
  add_index_quietly(store_, {.kind = IndexKind::kdtree, .leaf = 2});
  const auto roomy = tree_of(store_ / index_folder("", 0, "kdtree"));
  NoProgress silent;
  add_index(store_,
            {.kind = IndexKind::kdtree,
             .leaf = 2,
             .memory = std::uint64_t{56} << 20,
             .threads = 1,
             .force = true},
            silent);
  EXPECT_TRUE(tree_of(store_ / index_folder("", 0, "kdtree")) == roomy);
  // Those of one and the same leaf are made of ranges alone, or of samples.
  std::vector<std::uint8_t> samples(static_cast<std::size_t>(volume(extent_)));
  MemorySource again(extent_, ScalarType::u8, samples_of(StoreReader(store_), 0));
  convert_quietly(again, folder_ / "b",
                  {.brick = 16, .shard = 32, .levels = 2, .index = IndexKind::kdtree, .leaf = 2});
  EXPECT_TRUE(tree_of(folder_ / "b" / index_folder("", 0, "kdtree")) == roomy);
}

TEST_F(Indexes, AreReplacedOnlyByForce) {
  add_index_quietly(store_, {.leaf = 4});
  const auto first = tree_of(store_);
  EXPECT_NE(message_of([&] { add_index_quietly(store_, {.leaf = 8}); }).find("--force"),
            std::string::npos);
  EXPECT_NE(
      message_of([&] { add_index_quietly(store_, {.leaf = 8, .resume = true}); }).find("--force"),
      std::string::npos);
  EXPECT_EQ(add_index_quietly(store_, {.leaf = 4, .resume = true}).chunks_kept, 8u);
  EXPECT_TRUE(tree_of(store_) == first);
  add_index_quietly(store_, {.leaf = 8, .force = true});
  EXPECT_EQ(StoredIndex(StoreReader(store_), 0, "octree").layout().leaf, 8);
  add_index_quietly(store_, {.leaf = 4, .force = true});
  EXPECT_TRUE(tree_of(store_) == first);
}

TEST_F(Indexes, AnInterruptedBuildIsNoneAndIsResumed) {
  const auto before = tree_of(store_);
  fs::copy(store_, folder_ / "whole", fs::copy_options::recursive);
  add_index_quietly(folder_ / "whole", {.leaf = 4});
  const auto expected = tree_of(folder_ / "whole");
  for (int step = 0; step < 8; ++step) {
    fs::remove_all(folder_ / "b");
    fs::copy(store_, folder_ / "b", fs::copy_options::recursive);
    Stopping stopping("index", step);
    EXPECT_THROW(add_index(folder_ / "b", {.leaf = 4, .threads = 2}, stopping), Error);
    EXPECT_TRUE(stored_index_kinds(StoreReader(folder_ / "b"), 0).empty());
    EXPECT_THROW(mesh_of(folder_ / "b", {.isovalue = 77.5}, IndexKind::octree), UsageError);
    EXPECT_EQ(verify_quietly(folder_ / "b").damage_count, 0u);
    // Neither silently thrown away nor mixed with another leaf.
    EXPECT_NE(message_of([&] { add_index_quietly(folder_ / "b", {.leaf = 4}); }).find("--resume"),
              std::string::npos);
    EXPECT_NE(message_of([&] {
                add_index_quietly(folder_ / "b", {.leaf = 2, .resume = true});
              }).find("another leaf"),
              std::string::npos);
    const IndexReport report = add_index_quietly(folder_ / "b", {.leaf = 4, .resume = true});
    EXPECT_GE(report.chunks_kept, static_cast<std::uint64_t>(step));
    EXPECT_TRUE(tree_of(folder_ / "b") == expected);
  }
  EXPECT_TRUE(tree_of(store_) == before);
}

TEST_F(Indexes, AResumeMakesAnewWhatIsNotWhole) {
  Stopping stopping("index", 5);
  EXPECT_THROW(add_index(store_, {.leaf = 4, .threads = 2}, stopping), Error);
  const fs::path partial = store_ / index_folder("", 0, "octree.partial");
  fs::resize_file(partial / index_chunk_name({0, 0, 0}), 100);
  std::ofstream(partial / (index_chunk_name({1, 1, 0}) + ".tmp")) << "half";
  const IndexReport report = add_index_quietly(store_, {.leaf = 4, .resume = true});
  EXPECT_EQ(report.chunks_kept, 5u);
  EXPECT_EQ(verify_quietly(store_).damage_count, 0u);
  for (const auto& [file, bytes] : tree_of(store_))
    EXPECT_EQ(file.find(".tmp"), std::string::npos) << file;
}

TEST_F(Indexes, AConversionThatStopsInTheIndexIsResumed) {
  MemorySource source(extent_, ScalarType::u8, samples_of(StoreReader(store_), 0));
  const ConvertOptions options{
      .levels = 2, .resume = true, .index = IndexKind::interval, .leaf = 8};
  convert_quietly(source, folder_ / "whole", options);
  const auto expected = tree_of(folder_ / "whole");
  for (const int step : {0, 3, 7}) {
    fs::remove_all(folder_ / "b");
    Stopping stopping("index", step);
    EXPECT_THROW(convert(source, folder_ / "b", options, stopping), Error);
    EXPECT_FALSE(fs::exists(folder_ / "b"));
    // Another input is still noticed.
    MemorySource other = make_source<std::uint8_t>(extent_, 1);
    EXPECT_THROW(convert_quietly(other, folder_ / "b", options), Error);
    const ConvertReport report = convert_quietly(source, folder_ / "b", options);
    EXPECT_EQ(report.bricks_kept + report.bricks_absent, report.bricks);
    EXPECT_GT(report.index_bytes, 0u);
    EXPECT_TRUE(tree_of(folder_ / "b") == expected);
  }
}

TEST_F(Indexes, BudgetsThatAreTooSmallAreRefusedBeforeAnythingIsWritten) {
  const auto before = tree_of(store_);
  for (const Index leaf : {1, 16}) {
    const std::string text =
        message_of([&] { add_index_quietly(store_, {.leaf = leaf, .memory = 1 << 20}); });
    const std::uint64_t least = least_budget_in(text), mib = 1 << 20;
    EXPECT_THROW(add_index_quietly(store_, {.leaf = leaf, .memory = least - mib}), UsageError);
    EXPECT_TRUE(tree_of(store_) == before);
    add_index_quietly(store_, {.leaf = leaf, .memory = least});
    EXPECT_EQ(verify_quietly(store_).damage_count, 0u);
    fs::remove_all(store_ / "isobrick/0/index");
    fs::remove_all(store_ / "isobrick/1/index");
  }
  MemorySource source = make_source<std::uint8_t>({70, 70, 70}, 1);
  EXPECT_THROW(
      convert_quietly(
          source, folder_ / "b",
          {.memory = std::uint64_t{30} << 20, .threads = 2, .index = IndexKind::octree, .leaf = 1}),
      UsageError);
  EXPECT_FALSE(fs::exists(folder_ / "b.partial"));
}

TEST_F(Indexes, AKindThatTheStoreLacksIsRefusedWithTheCommandThatAddsIt) {
  const std::string text =
      message_of([&] { mesh_of(store_, {.isovalue = 77.5}, IndexKind::quadtree); });
  EXPECT_NE(text.find("--kind quadtree"), std::string::npos) << text;
  EXPECT_THROW(add_index_quietly(store_, {.kind = IndexKind::linear}), UsageError);
  EXPECT_THROW(add_index_quietly(store_, {.leaf = 3}), UsageError);
}

TEST_F(Indexes, AFailureLeavesTheStoreAsItWas) {
  // A file where a folder must be: also root cannot write below it.
  std::ofstream(store_ / "isobrick/1/index") << "in the way";
  const auto before = tree_of(store_);
  EXPECT_NE(message_of([&] { add_index_quietly(store_, {}); }), "");
  EXPECT_TRUE(stored_index_kinds(StoreReader(store_), 0).empty());
  auto after = tree_of(store_);
  std::erase_if(after, [](const auto& file) {
    return file.first.find("octree.partial/") != std::string::npos;
  });
  EXPECT_TRUE(after == before);
}

TEST_F(Indexes, WithoutCellsHaveNoChunks) {
  for (const Int3 extent : {Int3{70, 1, 30}, Int3{1, 1, 1}}) {
    fs::remove_all(folder_ / "b");
    MemorySource source = make_source<std::uint8_t>(extent, 1);
    convert_quietly(source, folder_ / "b", {.index = IndexKind::octree});
    EXPECT_EQ(mesh_of(folder_ / "b", {.isovalue = 50}, IndexKind::octree), "");
    EXPECT_EQ(verify_quietly(folder_ / "b").damage_count, 0u);
  }
}

}  // namespace
}  // namespace isobrick::test
