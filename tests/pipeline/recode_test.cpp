#include <isobrick/recode.h>

#include <gtest/gtest.h>

#include <isobrick/error.h>
#include <isobrick/verify.h>
#include "pipeline/convert/codec_choice.h"
#include "tests/pipeline/convert_store.h"

namespace isobrick::test {
namespace {

const ConvertOptions kStore{.brick = 20, .shard = 40, .threads = 2};

/// Stops after so many calls of advance().
class StopAfter final : public Progress {
 public:
  explicit StopAfter(int calls) : calls_(calls) {}
  void begin(std::string_view, std::uint64_t) override {}
  void advance(std::uint64_t) override {
    if (--calls_ <= 0) throw Cancelled("stopped");
  }
  void end() override {}

 private:
  int calls_;
};

ConvertOptions with(BrickCodec codec, ConvertOptions options = kStore) {
  options.codec = codec;
  return options;
}

template <class T>
class RecodeOfType : public testing::Test {};
using Types = testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t, std::uint32_t,
                             std::int32_t, float, double>;
TYPED_TEST_SUITE(RecodeOfType, Types);

TYPED_TEST(RecodeOfType, IsTheStoreThatAConversionMakes) {
  TemporaryFolder folder;
  MemorySource source = make_source<TypeParam>({70, 45, 51}, 5, true);
  convert_quietly(source, folder / "zstd", with(BrickCodec::zstd));
  convert_quietly(source, folder / "packed", with(BrickCodec::packed));
  recode(StoreReader(folder / "zstd"), folder / "p", {.codec = BrickCodec::packed, .threads = 3});
  EXPECT_EQ(tree_of(folder / "p"), tree_of(folder / "packed"));
  recode(StoreReader(folder / "packed"), folder / "z", {.codec = BrickCodec::zstd, .threads = 1});
  EXPECT_EQ(tree_of(folder / "z"), tree_of(folder / "zstd"));
}

TEST(Recode, GoesOnWhereItStopped) {
  TemporaryFolder folder;
  MemorySource source = make_source<std::uint16_t>({130, 90, 101}, 3);
  convert_quietly(source, folder / "a", kStore);
  const StoreReader store(folder / "a");
  recode(store, folder / "whole", {.codec = BrickCodec::packed});
  std::uint64_t most_kept = 0;
  for (const int calls : {1, 30, 60, 60, 60}) {
    StopAfter stop(calls);
    RecodeOptions options{.codec = BrickCodec::packed, .threads = 2, .resume = calls > 1};
    EXPECT_THROW(recode(store, folder / "b", options, stop), Cancelled) << calls;
    EXPECT_FALSE(std::filesystem::exists(folder / "b"));
  }
  const ConvertReport report =
      recode(store, folder / "b", {.codec = BrickCodec::packed, .resume = true});
  most_kept = std::max(most_kept, report.bricks_kept);
  EXPECT_GT(most_kept, 0u);
  EXPECT_EQ(tree_of(folder / "b"), tree_of(folder / "whole"));
}

TEST(Recode, OfAnotherStoreOrCodecIsNotGoneOnWith) {
  TemporaryFolder folder;
  MemorySource one = make_source<std::uint8_t>({70, 45, 51}, 5),
               two = make_source<std::uint8_t>({70, 45, 51}, 6);
  convert_quietly(one, folder / "one", kStore);
  convert_quietly(two, folder / "two", kStore);
  StopAfter stop(40);
  const StoreReader first(folder / "one"), second(folder / "two");
  EXPECT_THROW(recode(first, folder / "b", {.codec = BrickCodec::packed}, stop), Cancelled);
  const RecodeOptions resume{.codec = BrickCodec::packed, .resume = true};
  EXPECT_THROW(recode(second, folder / "b", resume), Error);
  EXPECT_THROW(recode(first, folder / "b", {.codec = BrickCodec::none, .resume = true}), Error);
  recode(first, folder / "b", resume);
  NoProgress progress;
  EXPECT_EQ(verify(folder / "b", {.threads = 2}, progress).damage_count, 0u);
}

TEST(Recode, AConversionDoesNotGoOnWithIt) {
  TemporaryFolder folder;
  MemorySource source = make_source<std::uint8_t>({70, 45, 51}, 5);
  convert_quietly(source, folder / "a", kStore);
  StopAfter stop(40);
  EXPECT_THROW(recode(StoreReader(folder / "a"), folder / "b", {.codec = BrickCodec::packed}, stop),
               Cancelled);
  ConvertOptions options = with(BrickCodec::packed);
  options.resume = true;
  EXPECT_THROW(convert_quietly(source, folder / "b", options), Error);
}

TEST(Recode, AutoGoesOnWithTheCodecThatItBegan) {
  TemporaryFolder folder;
  MemorySource source = make_source<std::uint16_t>({130, 90, 101}, 3);
  convert_quietly(source, folder / "a", kStore);
  const StoreReader store(folder / "a");
  for (const double factor : {1e-3, 1e3}) {
    const BrickCodec codec = factor < 1 ? BrickCodec::zstd : BrickCodec::packed;
    StopAfter stop(40);
    EXPECT_THROW(recode(store, folder / "b", {.packed_factor = factor}, stop), Cancelled);
    // Whatever a new choice would be.
    const ConvertReport report =
        recode(store, folder / "b", {.packed_factor = 1 / factor, .resume = true});
    EXPECT_EQ(report.codec, codec == BrickCodec::zstd ? "zstd:3" : "packed");
    EXPECT_FALSE(report.codec_sample);
    convert_quietly(source, folder / "c", with(codec));
    EXPECT_EQ(tree_of(folder / "b"), tree_of(folder / "c"));
    std::filesystem::remove_all(folder / "b");
    std::filesystem::remove_all(folder / "c");
  }
}

TEST(Recode, ForeignImagesAreRefused) {
  TemporaryFolder folder;
  MemorySource source = make_source<std::uint8_t>({20, 20, 20}, 3);
  convert_quietly(source, folder / "a", {});
  std::string root = content_of(folder / "a/zarr.json");
  root.replace(root.find("\"isobrick\""), 10, "\"foreign1\"");
  std::filesystem::remove_all(folder / "a/isobrick");
  std::ofstream(folder / "a/zarr.json") << root;
  EXPECT_THROW(recode(StoreReader(folder / "a"), folder / "b", {}), UsageError);
}

TEST(Recode, TakesNoMoreThanItsBudget) {
  TemporaryFolder folder;
  MemorySource source = make_source<std::uint8_t>({70, 45, 51}, 5);
  convert_quietly(source, folder / "a", kStore);
  const StoreReader store(folder / "a");
  EXPECT_THROW(recode(store, folder / "b", {.memory = 1 << 20}), UsageError);
  EXPECT_THROW(recode(store, folder / "b", {.threads = -1}), UsageError);
  EXPECT_THROW(recode(store, folder / "b", {.zstd_level = 23}), UsageError);
  EXPECT_THROW(recode(store, folder / "b", {.packed_factor = 0}), UsageError);
  EXPECT_FALSE(std::filesystem::exists(folder / "b.partial"));
}

// A conversion by `automatic`: of files, of streams, and resumed.
TEST(CodecChoice, OfAConversionIsTheSameForStreams) {
  TemporaryFolder folder;
  MemorySource file = make_source<std::uint16_t>({130, 90, 101}, 3),
               stream = make_source<std::uint16_t>({130, 90, 101}, 3, false, false);
  const ConvertReport a = convert_quietly(file, folder / "a", with(BrickCodec::automatic)),
                      b = convert_quietly(stream, folder / "b", with(BrickCodec::automatic));
  EXPECT_EQ(a.codec, b.codec);
  ASSERT_TRUE(a.codec_sample && b.codec_sample);
  EXPECT_EQ(a.codec_sample->packed_bytes, b.codec_sample->packed_bytes);
  EXPECT_EQ(a.codec_sample->zstd_bytes, b.codec_sample->zstd_bytes);
  EXPECT_EQ(tree_of(folder / "a"), tree_of(folder / "b"));
}

TEST(CodecChoice, OfAResumedConversionIsThatOfTheInterruptedOne) {
  TemporaryFolder folder;
  for (const double factor : {1e-3, 1e3}) {
    MemorySource source = make_source<std::uint16_t>({130, 90, 101}, 3);
    ConvertOptions options = with(BrickCodec::automatic);
    options.packed_factor = factor;
    StopAfter stop(60);
    EXPECT_THROW(convert(source, folder / "a", options, stop), Cancelled);
    options.packed_factor = 1 / factor;
    options.resume = true;
    EXPECT_EQ(convert_quietly(source, folder / "a", options).codec,
              factor < 1 ? "zstd:3" : "packed");
    std::filesystem::remove_all(folder / "a");
  }
}

TEST(CodecChoice, LooksAtSomeBricksOfAnyLattice) {
  std::vector<Int3> seen;
  std::mutex mutex;
  const Lattice lattice{{6400, 640, 64000}, {64, 64, 64}, ScalarType::u8};
  const CodecSample sample = sample_bricks(lattice, 0, 3, [&](Int3 b, std::span<std::byte> out) {
    const std::lock_guard lock(mutex);
    seen.push_back(b);
    std::fill(out.begin(), out.end(), std::byte{1});
    return true;
  });
  EXPECT_EQ(sample.bricks, 32u);
  EXPECT_EQ(sample.bytes, 32u << 18);
  ASSERT_EQ(seen.size(), 32u);
  // Spread: each eighth of the long axis has some.
  for (int part = 0; part < 8; ++part)
    EXPECT_TRUE(std::any_of(seen.begin(), seen.end(), [&](Int3 b) {
      return b.z / 125 == part && b.x < 100 && b.y < 10;
    })) << part;
}

TEST(CodecChoice, WithoutAStoredBrickIsZstd) {
  int asked = 0;
  std::mutex mutex;
  const Lattice lattice{{6400, 6400, 6400}, {64, 64, 64}, ScalarType::u8};
  const CodecSample none = sample_bricks(lattice, 0, 3, [&](Int3, std::span<std::byte>) {
    const std::lock_guard lock(mutex);
    return ++asked, false;
  });
  EXPECT_EQ(none.bricks, 0u);
  EXPECT_LE(asked, 256);
  EXPECT_EQ(better_codec(none, 1e9), BrickCodec::zstd);
  EXPECT_EQ(better_codec({.bricks = 1, .zstd_bytes = 100, .packed_bytes = 110}, 1.1),
            BrickCodec::packed);
  EXPECT_EQ(better_codec({.bricks = 1, .zstd_bytes = 100, .packed_bytes = 112}, 1.1),
            BrickCodec::zstd);
}

}  // namespace
}  // namespace isobrick::test
