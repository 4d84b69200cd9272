#include <isobrick/open_source.h>

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <thread>

#include "test_samples.h"
#include "tests/io/bytes/temp_dir.h"

namespace isobrick::inline v0 {
namespace {

constexpr Int3 kExtent{7, 5, 4};

std::string whole(ScalarType type, bool swapped = false) {
  return sample_bytes(type, {{0, 0, 0}, kExtent}, kExtent, swapped);
}

VolumeRequest describe(Int3 extent, ScalarType type) {
  VolumeRequest request;
  request.extent = extent;
  request.type = type;
  return request;
}

TEST(OpenSource, AllTypesAndBothByteOrders) {
  const TempDir dir;
  for (const ScalarType type : kScalarTypes)
    for (const ByteOrder order : {ByteOrder::little, ByteOrder::big}) {
      const auto path = dir.write("v.raw", whole(type, order == ByteOrder::big));
      VolumeRequest request = describe(kExtent, type);
      request.order = order;
      const auto source = open_source(path, request);
      EXPECT_TRUE(source->random_access());
      EXPECT_EQ(source->info().extent, kExtent);
      EXPECT_EQ(source->info().type, type);
      EXPECT_EQ(source->info().name, path);
      EXPECT_EQ(read_box(*source, {{0, 0, 0}, kExtent}), whole(type));
      const Box3 inner{{1, 2, 1}, {6, 4, 3}};
      EXPECT_EQ(read_box(*source, inner), sample_bytes(type, inner, kExtent));
    }
}

TEST(OpenSource, EveryBox) {
  const TempDir dir;
  const auto source =
      open_source(dir.write("v_7x5x4_u16.raw", whole(ScalarType::u16)), VolumeRequest{});
  for_each_point({{0, 0, 0}, kExtent}, [&](Int3 lo) {
    for_each_point({lo + Int3{1, 1, 1}, kExtent + Int3{1, 1, 1}}, [&](Int3 hi) {
      source->will_need({lo, hi});
      EXPECT_EQ(read_box(*source, {lo, hi}), sample_bytes(ScalarType::u16, {lo, hi}, kExtent));
    });
  });
}

TEST(OpenSource, WideRowsAreReadOneByOne) {
  const TempDir dir;
  const Int3 extent{9000, 3, 2};
  const auto path = dir.write("v.raw", sample_bytes(ScalarType::i16, {{0, 0, 0}, extent}, extent));
  const auto source = open_source(path, describe(extent, ScalarType::i16));
  const Box3 box{{100, 1, 0}, {150, 3, 2}};
  EXPECT_EQ(read_box(*source, box), sample_bytes(ScalarType::i16, box, extent));
}

TEST(OpenSource, ThreadsReadAtOnce) {
  const TempDir dir;
  const auto source =
      open_source(dir.write("v_7x5x4_f64.raw", whole(ScalarType::f64)), VolumeRequest{});
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      const Box3 box{{t, 0, 0}, {t + 2, 5, 4}};
      for (int i = 0; i < 200; ++i)
        EXPECT_EQ(read_box(*source, box), sample_bytes(ScalarType::f64, box, kExtent));
    });
  for (auto& thread : threads) thread.join();
}

TEST(OpenSource, SkipsAnOffset) {
  const TempDir dir;
  const auto path = dir.write("v.raw", "12345" + whole(ScalarType::f32));
  VolumeRequest request = describe(kExtent, ScalarType::f32);
  request.offset = 5;
  EXPECT_EQ(read_box(*open_source(path, request), {{0, 0, 0}, kExtent}), whole(ScalarType::f32));
}

TEST(OpenSource, SizeErrorsNameBothNumbersAndHelp) {
  const TempDir dir;
  const auto path = dir.write("v.raw", whole(ScalarType::u16));
  auto message = message_of([&] { open_source(path, describe(kExtent, ScalarType::u8)); });
  EXPECT_TRUE(contains(message, "280")) << message;
  EXPECT_TRUE(contains(message, "140")) << message;
  EXPECT_TRUE(contains(message, "--type u16 or i16")) << message;
  message = message_of([&] { open_source(path, describe({7, 5, 3}, ScalarType::u16)); });
  EXPECT_TRUE(contains(message, "--offset 70")) << message;
  message = message_of([&] { open_source(path, describe({100, 100, 100}, ScalarType::u16)); });
  EXPECT_TRUE(contains(message, "280") && contains(message, "2000000")) << message;
  VolumeRequest request = describe(kExtent, ScalarType::u16);
  request.offset = ~std::uint64_t{0};
  message_of([&] { open_source(path, request); });
  request.offset = 1;
  message_of([&] { open_source(path, request); });
}

TEST(OpenSource, RefusesExtentsThatMakeNoSense) {
  const TempDir dir;
  const auto path = dir.write("v.raw", "");
  constexpr Index huge = Index{1} << 40;
  for (const Int3 extent : {Int3{0, 1, 1}, Int3{1, -5, 1}, Int3{huge, huge, huge},
                            Int3{std::numeric_limits<Index>::max(), 2, 1}})
    message_of([&] { open_source(path, describe(extent, ScalarType::u8)); });
  const auto named = dir.write("v_99999999999999999999x1x1_u8.raw", "");
  EXPECT_TRUE(contains(message_of([&] { open_source(named, {}); }), "too large"));
}

TEST(OpenSource, SaysWhatIsNotKnown) {
  const TempDir dir;
  EXPECT_TRUE(
      contains(message_of([&] { open_source(dir.write("v.raw", ""), {}); }), "extent and type"));
  EXPECT_TRUE(contains(message_of([&] { open_source(dir.write("v_u8.raw", ""), {}); }), "extent"));
  EXPECT_TRUE(contains(message_of([&] { open_source(dir.write("v_1x1x1.raw", ""), {}); }), "type"));
}

TEST(OpenSource, NanoVdbIsRefusedWithWhatToDo) {
  const TempDir dir;
  // By its name and, of whatever name, by what files and single grids begin with.
  for (const auto& path : {dir.write("v.nvdb", "?"), dir.write("v.raw", "NanoVDB0 and more"),
                           dir.write("v.bin", "NanoVDB2 and more")}) {
    const std::string message = message_of<UsageError>([&] { open_source(path, {}); });
    EXPECT_TRUE(contains(message, path)) << message;
    EXPECT_TRUE(contains(message, "nanovdb_convert")) << message;
  }
  EXPECT_EQ(open_source(dir.write("r_2x2x2_uint8.raw", "RawBytes"), {})->info().extent,
            (Int3{2, 2, 2}));
}

TEST(OpenSource, RefusesWhatIsNoFile) {
  const TempDir dir;
  const VolumeRequest request = describe(kExtent, ScalarType::u8);
  message_of<Error>([&] { open_source(dir / "missing.raw", request); });
  EXPECT_TRUE(contains(message_of([&] { open_source(dir / ".", request); }), "directory"));
  ASSERT_EQ(::mkfifo((dir / "pipe").c_str(), 0600), 0);
  EXPECT_TRUE(contains(message_of([&] { open_source(dir / "pipe", request); }), "regular"));
}

TEST(OpenSource, NamesTheFileThatShrank) {
  const TempDir dir;
  const auto path = dir.write("v_7x5x4_u8.raw", whole(ScalarType::u8));
  const auto source = open_source(path, {});
  std::filesystem::resize_file(path, 100);
  const auto message = message_of<Error>([&] { read_box(*source, {{0, 0, 0}, kExtent}); });
  EXPECT_TRUE(contains(message, path) && contains(message, "100")) << message;
}

TEST(OpenSource, SaidBeforeHeaderBeforeName) {
  const TempDir dir;
  // 140 bytes by the name, but the header knows better.
  const auto path = dir.write("v_1x1x1_f64.raw", whole(ScalarType::u16));
  dir.write("v_1x1x1_f64.nhdr",
            "NRRD0004\ntype: ushort\ndimension: 3\nsizes: 7 5 4\nencoding: raw\nendian: little\n"
            "spacings: 1 2 3\ndata file: v_1x1x1_f64.raw\n");
  auto source = open_source(path, {});
  EXPECT_EQ(source->info().extent, kExtent);
  EXPECT_EQ(source->info().type, ScalarType::u16);
  EXPECT_EQ(source->info().transform.spacing, (Vec3d{1, 2, 3}));

  VolumeRequest request;
  request.type = ScalarType::i16;
  request.spacing = Vec3d{4, 4, 4};
  request.origin = Vec3d{1, 0, 0};
  request.unit = "um";
  request.order = ByteOrder::big;
  source = open_source(path, request);
  EXPECT_EQ(source->info().type, ScalarType::i16);
  EXPECT_EQ(source->info().extent, kExtent);
  EXPECT_EQ(source->info().transform.spacing, (Vec3d{4, 4, 4}));
  EXPECT_EQ(source->info().transform.origin, (Vec3d{1, 0, 0}));
  EXPECT_EQ(source->info().transform.unit, "micrometer");
  EXPECT_NE(read_box(*source, {{0, 0, 0}, kExtent}), whole(ScalarType::u16));

  request.unit = "furlong";
  const auto message = message_of<UsageError>([&] { open_source(path, request); });
  EXPECT_TRUE(contains(message, "furlong") && contains(message, "millimeter")) << message;
}

TEST(OpenSource, AHeaderBesideThatMeansAnotherFileIsNotUsed) {
  const TempDir dir;
  const auto path = dir.write("v.raw", whole(ScalarType::u8));
  dir.write("other.raw", "");
  dir.write("v.mhd",
            "NDims = 3\nDimSize = 7 5 4\nElementType = MET_UCHAR\nElementDataFile = other.raw\n");
  message_of([&] { open_source(path, {}); });
}

TEST(OpenSource, ADamagedHeaderBesideMattersOnlyIfNeeded) {
  const TempDir dir;
  const auto path = dir.write("v.raw", whole(ScalarType::u8));
  dir.write("v.nhdr", "nonsense");
  EXPECT_TRUE(contains(message_of([&] { open_source(path, {}); }), "v.nhdr"));
  EXPECT_NO_THROW(open_source(path, describe(kExtent, ScalarType::u8)));
}

TEST(OpenSource, RawSamplesMayBeginLikeAnotherFormat) {
  const TempDir dir;
  const std::string samples = "II*" + std::string(137, '\0');
  const auto source = open_source(dir.write("v.raw", samples), describe(kExtent, ScalarType::u8));
  EXPECT_EQ(read_box(*source, {{0, 0, 0}, kExtent}), samples);
}

TEST(OpenSource, SpacingMustBePositive) {
  const TempDir dir;
  const auto path = dir.write("v_7x5x4_u8.raw", whole(ScalarType::u8));
  VolumeRequest request;
  request.spacing = Vec3d{1, 0, 1};
  message_of([&] { open_source(path, request); });
}

}  // namespace
}  // namespace isobrick
