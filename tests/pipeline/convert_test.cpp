#include <gtest/gtest.h>

#include <algorithm>

#include <isobrick/error.h>
#include <isobrick/verify.h>
#include "pipeline/convert/downsample.h"
#include "pipeline/histogram/histogram.h"
#include "tests/pipeline/convert_store.h"
#include "tests/pipeline/least_budget.h"
#include "tests/pipeline/naive_counts.h"

namespace isobrick::inline v0 {
namespace {

using namespace test;

ConvertOptions small_bricks() {
  ConvertOptions options;
  options.brick = 16;
  options.shard = 32;
  options.threads = 2;
  return options;
}

template <class T>
class Convert : public ::testing::Test {};
using SampleTypes = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                     std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(Convert, SampleTypes);

TYPED_TEST(Convert, KeepsEverySampleAndItsRanges) {
  using T = TypeParam;
  for (const Int3 extent : {Int3{70, 45, 51}, Int3{1, 1, 1}, Int3{16, 33, 1}}) {
    TemporaryFolder folder;
    MemorySource source = make_source<T>(extent, 5, true);
    const ConvertReport report = convert_quietly(source, folder / "a.zarr", small_bricks());
    EXPECT_EQ(source.bytes_read(), bytes_of(extent, scalar_type_of<T>));
    EXPECT_EQ(report.bytes_in, source.bytes_read());
    EXPECT_FALSE(std::filesystem::exists(folder / "a.zarr.partial"));

    const StoreReader store(folder / "a.zarr");
    ASSERT_EQ(store.info().levels.size(), static_cast<std::size_t>(report.levels));
    EXPECT_EQ(samples_of(store, 0), source.samples());
    EXPECT_EQ(stored_counts(store), naive_counts(scalar_type_of<T>, source.samples()));
    Int3 e = extent;
    std::vector<std::byte> expected = source.samples();
    for (int level = 0; level < report.levels; ++level) {
      const Lattice& lattice = store.info().levels[static_cast<std::size_t>(level)].lattice;
      ASSERT_EQ(lattice.extent, e);
      ASSERT_EQ(samples_of(store, level), expected) << level;
      std::vector<T> typed(expected.size() / sizeof(T));
      std::memcpy(typed.data(), expected.data(), expected.size());
      const RangeTable blocks = store.block_ranges(level, {{0, 0, 0}, lattice.blocks()});
      for_each_point(blocks.box, [&](Int3 p) {
        const auto range = brute_range(typed, e, p, kBlockEdge);
        EXPECT_EQ(blocks.at(p).empty(), range.empty());
        if (range.empty()) return;
        EXPECT_EQ(blocks.at(p).lo, static_cast<double>(range.lo));
        EXPECT_EQ(blocks.at(p).hi, static_cast<double>(range.hi));
      });
      std::vector<std::byte> half(bytes_of(coarser_extent(e, kHalveAll), scalar_type_of<T>));
      downsample(Downsampling::mean, scalar_type_of<T>, e, kHalveAll, expected.data(), half.data());
      expected = half;
      e = coarser_extent(e, kHalveAll);
    }
    NoProgress progress;
    const VerifyReport check = verify(folder / "a.zarr", {.threads = 2}, progress);
    EXPECT_EQ(check.damage_count, 0u) << (check.damages.empty() ? "" : check.damages[0]);
    EXPECT_EQ(check.bricks, report.bricks);
    bool nan = false;
    for (const T v : make_samples<T>(extent, 5, true)) nan |= v != v;
    EXPECT_EQ(store.info().may_have_nan, nan);
  }
}

TEST(ConvertLayout, BytesDependOnNothingButTheInputAndTheOptions) {
  const Int3 extent{83, 61, 75};
  TemporaryFolder folder;
  for (const Index brick : {16, 22, 33}) {
    ConvertOptions options;
    options.brick = brick;
    options.shard = 2 * brick;
    MemorySource source = make_source<std::uint16_t>(extent, 9);
    MemorySource stream = make_source<std::uint16_t>(extent, 9, false, false);
    options.threads = 1;
    options.force = true;
    convert_quietly(source, folder / "one", options);
    options.threads = 4;
    convert_quietly(source, folder / "four", options);
    convert_quietly(stream, folder / "stream", options);
    EXPECT_EQ(tree_of(folder / "one"), tree_of(folder / "four"));
    EXPECT_EQ(tree_of(folder / "one"), tree_of(folder / "stream"));
    NoProgress progress;
    EXPECT_EQ(verify(folder / "one", {.threads = 1}, progress).damage_count, 0u);
  }
}

/// The least budget, from the message of a smaller one.
std::uint64_t least_budget(VolumeSource& source, ConvertOptions options,
                           const TemporaryFolder& folder) {
  options.memory = 1;
  try {
    convert_quietly(source, folder / "none", options);
  } catch (const UsageError& e) {
    return least_budget_in(e.what());
  }
  return 0;
}

TEST(ConvertBudget, SlowerPathsWriteTheSameBytes) {
  // A slab has 15 MiB more than the least budget leaves for samples.
  const Int3 extent{400, 300, 36};
  TemporaryFolder folder;
  ConvertOptions options{.brick = 16, .shard = 512, .zstd_level = 1, .threads = 2};
  MemorySource source = make_source<double>(extent, 4);
  convert_quietly(source, folder / "fast", options);
  const auto fast = tree_of(folder / "fast");

  options.memory = least_budget(source, options, folder);
  ASSERT_GT(options.memory, 0u);
  EXPECT_LT(options.memory, std::uint64_t{64} << 20);
  EXPECT_FALSE(std::filesystem::exists(folder / "none.partial"));
  MemorySource again(source);
  convert_quietly(again, folder / "least", options);
  EXPECT_EQ(again.bytes_read(), source.samples().size());
  EXPECT_EQ(tree_of(folder / "least"), fast);
  options.memory += std::uint64_t{6} << 20;  // whole rows, then a cascade from level 1 on
  convert_quietly(source, folder / "more", options);
  EXPECT_EQ(tree_of(folder / "more"), fast);

  MemorySource stream(extent, ScalarType::f64, source.samples(), false);
  options.memory = least_budget(stream, options, folder);
  convert_quietly(stream, folder / "stream", options);
  EXPECT_EQ(tree_of(folder / "stream"), fast);
}

TEST(ConvertBudget, OddBricksKeepSamplesAndRangesInPieces) {
  const Int3 extent{150, 140, 100};
  TemporaryFolder folder;
  ConvertOptions options{.brick = 33, .shard = 99, .threads = 1};
  MemorySource source = make_source<double>(extent, 8);
  options.memory = least_budget(source, options, folder);
  convert_quietly(source, folder / "a", options);
  const StoreReader store(folder / "a");
  EXPECT_EQ(samples_of(store, 0), source.samples());
  NoProgress progress;
  EXPECT_EQ(verify(folder / "a", {.threads = 2}, progress).damage_count, 0u);
}

TEST(ConvertResume, FinishesWhatWasInterruptedByteForByte) {
  const Int3 extent{70, 50, 83};
  TemporaryFolder folder;
  MemorySource source = make_source<float>(extent, 3, true);
  const ConvertOptions once = small_bricks();
  convert_quietly(source, folder / "whole", once);
  const auto whole = tree_of(folder / "whole");
  ConvertOptions resume = once;
  resume.resume = true;
  const std::uint64_t total = source.samples().size();
  std::uint64_t most_kept = 0;
  for (std::uint64_t part = 0; part < 12; ++part) {
    MemorySource broken(source);
    broken.fail_after(total * part / 12);
    EXPECT_THROW(convert_quietly(broken, folder / "a", once), Error);
    EXPECT_FALSE(std::filesystem::exists(folder / "a"));
    // Once more interrupted while it resumes.
    MemorySource again(source);
    again.fail_after(total * (part + 1) / 13);
    EXPECT_THROW(convert_quietly(again, folder / "a", resume), Error);
    const ConvertReport report = convert_quietly(source, folder / "a", resume);
    most_kept = std::max(most_kept, report.bricks_kept);
    EXPECT_EQ(tree_of(folder / "a"), whole) << part;
    std::filesystem::remove_all(folder / "a");
  }
  EXPECT_GT(most_kept, 30u);
}

TEST(ConvertResume, RefusesAnotherInputOrOtherOptions) {
  const Int3 extent{64, 64, 80};
  TemporaryFolder folder;
  MemorySource source = make_source<std::uint8_t>(extent, 3);
  MemorySource broken(source);
  broken.fail_after(source.samples().size() - 1);
  ConvertOptions options = small_bricks();
  EXPECT_THROW(convert_quietly(broken, folder / "a", options), Error);
  EXPECT_THROW(convert_quietly(source, folder / "a", options),
               UsageError);  // names --resume, --force
  options.resume = true;
  MemorySource other = make_source<std::uint8_t>(extent, 4);
  EXPECT_THROW(convert_quietly(other, folder / "a", options), Error);
  options.zstd_level = 5;
  EXPECT_THROW(convert_quietly(source, folder / "a", options), Error);
  options = small_bricks();
  options.force = true;  // starts anew
  const ConvertReport report = convert_quietly(source, folder / "a", options);
  EXPECT_EQ(report.bricks_kept, 0u);
  EXPECT_EQ(samples_of(StoreReader(folder / "a"), 0), source.samples());
}

TEST(ConvertPlace, ReplacesAStoreOnlyWhenTheNewOneIsWhole) {
  const Int3 extent{40, 40, 40};
  TemporaryFolder folder;
  MemorySource first = make_source<std::uint8_t>(extent, 1),
               second = make_source<std::uint8_t>(extent, 2);
  ConvertOptions options = small_bricks();
  convert_quietly(first, folder / "a", options);
  MemorySource untouched(second);
  EXPECT_THROW(convert_quietly(untouched, folder / "a", options), UsageError);
  EXPECT_EQ(untouched.bytes_read(), 0u);
  options.force = true;
  MemorySource broken(second);
  broken.fail_after(second.samples().size() / 2);
  EXPECT_THROW(convert_quietly(broken, folder / "a", options), Error);
  EXPECT_EQ(samples_of(StoreReader(folder / "a"), 0), first.samples());
  convert_quietly(second, folder / "a", options);
  EXPECT_EQ(samples_of(StoreReader(folder / "a"), 0), second.samples());
  EXPECT_FALSE(std::filesystem::exists(folder / "a.partial"));
}

TEST(ConvertPlace, NeverReplacesWhatIsNoStore) {
  TemporaryFolder folder;
  std::ofstream(folder / "a") << "precious";
  std::filesystem::create_directory(folder / "b");
  std::ofstream(folder / "b" / "file") << "precious";
  MemorySource source = make_source<std::uint8_t>({20, 20, 20}, 1);
  ConvertOptions options = small_bricks();
  options.force = true;
  EXPECT_THROW(convert_quietly(source, folder / "a", options), UsageError);
  EXPECT_THROW(convert_quietly(source, folder / "b", options), UsageError);
  EXPECT_EQ(content_of(folder / "a"), "precious");
  EXPECT_EQ(content_of(folder / "b" / "file"), "precious");
}

TEST(ConvertPlace, NeverClearsWhatNoConversionLeft) {
  namespace fs = std::filesystem;
  TemporaryFolder folder;
  MemorySource source = make_source<std::uint8_t>({20, 20, 20}, 1);
  MemorySource broken(source);
  broken.fail_after(1);
  const auto refused = [&](const fs::path& out) {
    for (const bool resume : {false, true})
      for (const bool force : {false, true}) {
        ConvertOptions options = small_bricks();
        options.resume = resume;
        options.force = force;
        EXPECT_THROW(convert_quietly(source, out, options), UsageError) << resume << force;
      }
  };
  fs::create_directory(folder / "a.partial");
  std::ofstream(folder / "a.partial" / "zarr.json") << "precious";
  refused(folder / "a");
  EXPECT_EQ(content_of(folder / "a.partial" / "zarr.json"), "precious");
  fs::rename(folder / "a.partial" / "zarr.json", folder / "a.partial" / "notes.tmp");
  refused(folder / "a");
  EXPECT_EQ(content_of(folder / "a.partial" / "notes.tmp"), "precious");
  // An interrupted conversion, but behind a link.
  EXPECT_THROW(convert_quietly(broken, folder / "b", small_bricks()), Error);
  fs::rename(folder / "b.partial", folder / "real");
  fs::create_directory_symlink(folder / "real", folder / "b.partial");
  const auto before = tree_of(folder / "real");
  refused(folder / "b");
  EXPECT_EQ(tree_of(folder / "real"), before);
  // The store itself is a link: to a store, to nothing.
  convert_quietly(source, folder / "store", small_bricks());
  fs::create_directory_symlink(folder / "store", folder / "c");
  fs::create_directory_symlink(folder / "nothing", folder / "d");
  refused(folder / "c");
  refused(folder / "d");
  EXPECT_TRUE(fs::is_symlink(folder / "c"));
  EXPECT_EQ(samples_of(StoreReader(folder / "store"), 0), source.samples());
  // An empty folder is anybody's.
  fs::create_directory(folder / "e.partial");
  convert_quietly(source, folder / "e", small_bricks());
}

/// Wants an end after some calls, as Ctrl-C does.
class Impatient final : public Progress {
 public:
  void begin(std::string_view, std::uint64_t total) override { total_ = total; }
  void advance(std::uint64_t done) override {
    done_ += done;
    if (--patience_ == 0) throw std::runtime_error("enough");
  }
  void end() override {}

  int patience_ = -1;
  std::uint64_t total_ = 0, done_ = 0;
};

TEST(ConvertProgress, ComesWithEveryBrickAndCanStop) {
  TemporaryFolder folder;
  MemorySource source = make_source<std::uint16_t>({90, 70, 50}, 1);
  Impatient progress;
  convert(source, folder / "a", small_bricks(), progress);
  EXPECT_EQ(progress.done_, source.samples().size());
  EXPECT_EQ(progress.total_, progress.done_);
  Impatient soon;
  soon.patience_ = 3;  // bricks of the first slab, which holds all of them
  EXPECT_THROW(convert(source, folder / "b", small_bricks(), soon), std::runtime_error);
  EXPECT_LE(soon.done_, 3u * 16 * 16 * 16 * 2);
  EXPECT_FALSE(std::filesystem::exists(folder / "b"));
  ConvertOptions resume = small_bricks();
  resume.resume = true;
  convert_quietly(source, folder / "b", resume);
  EXPECT_EQ(tree_of(folder / "b"), tree_of(folder / "a"));
}

TEST(ConvertLayout, LevelsLieInTheWorldWhereTheirSamplesAre) {
  TemporaryFolder folder;
  MemorySource source = make_source<std::uint8_t>({64, 40, 1}, 1);
  source.mutable_info().transform.spacing = {0.5, 1, 3};
  source.mutable_info().transform.origin = {10, 20, 30};
  ConvertOptions options = small_bricks();
  options.factors = {kHalveAll};
  convert_quietly(source, folder / "a", options);
  const StoreReader store(folder / "a");
  ASSERT_EQ(store.info().levels.size(), 3u);
  EXPECT_EQ(store.info().levels[2].lattice.extent, (Int3{16, 10, 1}));
  EXPECT_EQ(store.info().levels[2].transform.spacing, (Vec3d{2, 4, 3}));
  EXPECT_EQ(store.info().levels[2].transform.origin, (Vec3d{10.75, 21.5, 30}));
}

TEST(ConvertLayout, EmptyVolumesCostNothing) {
  TemporaryFolder folder;
  MemorySource source({100, 100, 100}, ScalarType::f32, std::vector<std::byte>(4000000));
  const ConvertReport report = convert_quietly(source, folder / "a", small_bricks());
  EXPECT_EQ(report.bricks, report.bricks_absent);
  EXPECT_EQ(samples_of(StoreReader(folder / "a"), 0), source.samples());
}

TEST(ConvertOptionsCheck, RefusesWhatMakesNoSense) {
  TemporaryFolder folder;
  MemorySource source = make_source<std::uint8_t>({20, 20, 20}, 1);
  const auto refused = [&](auto change) {
    ConvertOptions options = small_bricks();
    change(options);
    EXPECT_THROW(convert_quietly(source, folder / "a", options), UsageError);
  };
  refused([](ConvertOptions& o) { o.brick = 15; });
  refused([](ConvertOptions& o) { o.brick = 257; });
  refused([](ConvertOptions& o) { o.shard = 8; });
  refused([](ConvertOptions& o) { o.levels = 0; });
  refused([](ConvertOptions& o) { o.levels = 7; });
  refused([](ConvertOptions& o) { o.zstd_level = 23; });
  refused([](ConvertOptions& o) { o.memory = 1000; });
  EXPECT_FALSE(std::filesystem::exists(folder / "a.partial"));
}

}  // namespace
}  // namespace isobrick
