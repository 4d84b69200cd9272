#include <gtest/gtest.h>

#include <isobrick/error.h>
#include "tests/io/bytes/temp_dir.h"
#include "tools/console.h"
#include "tools/format.h"
#include "tools/mesh_output.h"
#include "tools/mesh_space.h"
#include "tools/output_name.h"
#include "tools/parse.h"

namespace isobrick::tools {
namespace {

TEST(Parse, Bytes) {
  EXPECT_EQ(parse_bytes("100000"), 100000u);
  EXPECT_EQ(parse_bytes("64K"), 65536u);
  EXPECT_EQ(parse_bytes("512M"), 536870912u);
  EXPECT_EQ(parse_bytes("1g"), 1073741824u);
  EXPECT_EQ(parse_bytes("1.5G"), 1610612736u);
  EXPECT_EQ(parse_bytes("2GiB"), 2147483648u);
  EXPECT_EQ(parse_bytes("2GB"), 2147483648u);
  EXPECT_EQ(parse_bytes("1T"), 1099511627776u);
  for (const char* text : {"", "G", "-1", "0", "1X", "1 G", "1Gi", "nan", "inf", "9999999T", "0.1"})
    EXPECT_THROW(parse_bytes(text), UsageError) << text;
}

TEST(Parse, Dims) {
  EXPECT_EQ(parse_dims("1,2,3"), (Int3{1, 2, 3}));
  for (const char* text :
       {"", "1,2", "1,2,3,4", "0,1,1", "-1,1,1", "1,,1", "a,1,1", "1.5,1,1", "1, 2,3",
        "9223372036854775807,2,2", "99999999999999999999,1,1", "3000000,3000000,3000000"})
    EXPECT_THROW(parse_dims(text), UsageError) << text;
}

TEST(Parse, Vector) {
  EXPECT_EQ(parse_vector("0.5,-1,+1e3"), (Vec3d{0.5, -1, 1000}));
  for (const char* text : {"1,2", "1,nan,1", "inf,1,1", "1,1,x"})
    EXPECT_THROW(parse_vector(text), UsageError) << text;
}

TEST(Parse, HalfSpace) {
  EXPECT_EQ(parse_half_space("0,-1,0.5,+20"), (HalfSpace{{0, -1, 0.5}, 20}));
  for (const char* text : {"", "1,2,3", "1,2,3,", "1,2,3,4,5", "0,0,0,1", "1,2,x,4", "1,2,3,inf"})
    EXPECT_THROW(parse_half_space(text), UsageError) << text;
}

TEST(Parse, Types) {
  EXPECT_EQ(parse_type("i16"), ScalarType::i16);
  EXPECT_EQ(parse_type("float64"), ScalarType::f64);
  EXPECT_EQ(parse_type("i64"), ScalarType::i64);
  EXPECT_EQ(parse_type("uint64"), ScalarType::u64);
  EXPECT_THROW(parse_type("f16"), UsageError);
  EXPECT_EQ(parse_byte_order("big"), ByteOrder::big);
  EXPECT_THROW(parse_byte_order("middle"), UsageError);
}

TEST(Parse, CodecAndLevels) {
  EXPECT_EQ(parse_codec("none").codec, BrickCodec::none);
  EXPECT_EQ(parse_codec("packed").codec, BrickCodec::packed);
  EXPECT_EQ(parse_codec("auto").codec, BrickCodec::automatic);
  EXPECT_EQ(parse_codec("auto").packed_factor, kMaxPackedFactor);
  EXPECT_EQ(parse_codec("auto:1.5").packed_factor, 1.5);
  for (const char* wrong : {"auto:", "auto:0", "auto:-2", "auto:nan", "auto:inf", "automatic"})
    EXPECT_THROW(parse_codec(wrong), UsageError) << wrong;
  EXPECT_EQ(parse_codec("zstd").codec, BrickCodec::zstd);
  EXPECT_EQ(parse_codec("zstd").zstd_level, 3);
  EXPECT_EQ(parse_codec("zstd:19").zstd_level, 19);
  for (const char* text : {"", "gzip", "zstd:", "zstd:0", "zstd:23", "zstd3"})
    EXPECT_THROW(parse_codec(text), UsageError) << text;
  EXPECT_EQ(parse_levels("auto"), std::nullopt);
  EXPECT_EQ(parse_levels("4"), 4);
  EXPECT_THROW(parse_levels("0"), UsageError);
}

TEST(Parse, Roi) {
  const Int3 extent{10, 20, 30};
  const auto box = [&](const char* text) { return resolve_region(parse_roi(text), extent); };
  EXPECT_EQ(box("1:2,3:4,5:6"), (Box3{{1, 3, 5}, {2, 4, 6}}));
  EXPECT_EQ(box(":5,,"), (Box3{{0, 0, 0}, {5, 20, 30}}));
  EXPECT_EQ(box(":,7:,:30"), (Box3{{0, 7, 0}, {10, 20, 30}}));
  for (const char* text : {"", ":", "1,2,3", ":,:", "a:b,,", "1:2:3,,", ",,,"})
    EXPECT_THROW(parse_roi(text), UsageError) << text;
  for (const char* text : {"-1:2,,", "0:11,,", "5:5,,", "6:5,,", ",20:,", ",,30:31"})
    EXPECT_THROW(box(text), UsageError) << text;
}

TEST(Parse, BoxesOfWorldSpace) {
  const auto [lo, hi] = parse_world_region("-1.5:2,3:4e1,5:6");
  EXPECT_EQ(lo, (Vec3d{-1.5, 3, 5}));
  EXPECT_EQ(hi, (Vec3d{2, 40, 6}));
  EXPECT_EQ(parse_world_region(":2,,5:").lo.z, 5);
  EXPECT_LT(parse_world_region(":2,,5:").lo.y, -1e20);
  EXPECT_GT(parse_world_region(":2,,5:").hi.z, 1e20);
  for (const char* text : {"", "1:2,3:4", "1:2,3:4,5", "1:2,3:4,6:6", "1:2,4:3,5:6",
                           "1:2,3:4,5:6,7:8", "1:2,3:4,5:x", "1:2,3:4,5:nan"})
    EXPECT_THROW(parse_world_region(text), UsageError) << text;
}

TEST(Parse, SizesOfPictures) {
  EXPECT_EQ(parse_picture_size("640x16").width, 640);
  EXPECT_EQ(parse_picture_size("640x16").height, 16);
  for (const char* text : {"", "x", "640", "640x", "640,480", "640x15", "16385x16", "640x480x2"})
    EXPECT_THROW(parse_picture_size(text), UsageError) << text;
}

TEST(Format, Figures) {
  EXPECT_EQ(human_bytes(std::uint64_t{999}), "999 B");
  EXPECT_EQ(human_bytes(std::uint64_t{1536}), "1.50 KiB");
  EXPECT_EQ(human_bytes(std::uint64_t{8} << 30), "8.00 GiB");
  EXPECT_EQ(human_count(0), "0");
  EXPECT_EQ(human_count(999), "999");
  EXPECT_EQ(human_count(1234567), "1,234,567");
  EXPECT_EQ(human_seconds(0.0123), "0.012 s");
  EXPECT_EQ(human_seconds(125), "2:05 min");
}

TEST(Mesh, ItsMemoryIsKnownBeforeItIsOpened) {
  constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;
  const TempDir dir;
  for (const MeshFormat format : {MeshFormat::ply, MeshFormat::stl, MeshFormat::obj,
                                  MeshFormat::glb, MeshFormat::vtp, MeshFormat::pvtp})
    for (const int threads : {0, 3})
      for (const std::uint64_t memory : {64 * kMiB, 1024 * kMiB}) {
        const MeshFileOptions options{
            .format = format, .force = true, .threads = threads, .memory = memory};
        EXPECT_EQ(mesh_file_memory(format, options), create_mesh_file(dir / "a", options)->memory())
            << name_of(format);
      }
  EXPECT_EQ(mesh_file_memory(MeshFormat::ply, {.memory = 64 * kMiB}), 0U);
}

TEST(Mesh, ItsFormatSaysWhetherItNumbersMoreThan32Bits) {
  const TempDir dir;
  for (const MeshFormat format :
       {MeshFormat::ply, MeshFormat::stl, MeshFormat::obj, MeshFormat::glb, MeshFormat::vtp,
        MeshFormat::pvtp, MeshFormat::tiles3d})
    EXPECT_EQ(takes_wide(format),
              create_mesh_file(dir / "a", {.format = format, .force = true})->takes_wide())
        << name_of(format);
}

TEST(Mesh, ItIsMadeOfPiecesWhereAnExtractionCannotNumberIt) {
  const PlannedMesh mesh{.form = {.format = MeshFormat::pvtp},
                         .size = {.vertices = 1000, .triangles = 2000},
                         .uncertainty = 0.1};
  EXPECT_TRUE(needs_pieces(mesh, 1000));
  EXPECT_TRUE(needs_pieces(mesh, 1099));
  EXPECT_FALSE(needs_pieces(mesh, 1100));
  PlannedMesh ply = mesh, smooth = mesh, metres = mesh;
  ply.form.format = MeshFormat::ply;
  EXPECT_FALSE(needs_pieces(ply, 1000));
  for (PlannedMesh* each : {&ply, &smooth}) each->filter.smooth = 3;
  EXPECT_TRUE(needs_pieces(smooth, 1000));
  EXPECT_FALSE(needs_pieces(ply, 1000));
  metres.filter.unit = "meter";
  metres.filter.measure = true;
  metres.form.format = MeshFormat::tiles3d;
  EXPECT_TRUE(needs_pieces(metres, 1000));
  // What is left may have numbers of 32 bits.
  ply.filter.largest = 1;
  EXPECT_TRUE(needs_pieces(ply, 1000));
}

TEST(Space, AMeshNeedsItsScratchFileToo) {
  const MeshSize size{.vertices = 100, .triangles = 200};
  const MeshBytes ply = predict_bytes({.format = MeshFormat::ply}, size);
  EXPECT_EQ(ply.needed, ply.file + 200 * 13);
  EXPECT_EQ(predict_bytes({.format = MeshFormat::ply, .normals = true}, size).file,
            ply.file + 100 * 12);
  const MeshBytes stl = predict_bytes({.format = MeshFormat::stl, .normals = true}, size);
  EXPECT_EQ(stl.needed, stl.file);
  const MeshForm glb{.format = MeshFormat::glb, .normals = true};
  const MeshForm quantized{.format = MeshFormat::glb, .normals = true, .quantize = true};
  EXPECT_EQ(predict_bytes(quantized, size).file + 100 * 8, predict_bytes(glb, size).file);
  for (const MeshFormat format :
       {MeshFormat::ply, MeshFormat::obj, MeshFormat::glb, MeshFormat::vtp, MeshFormat::pvtp})
    EXPECT_GT(predict_bytes({.format = format}, size).needed,
              predict_bytes({.format = format}, size).file)
        << name_of(format);
}

TEST(Space, ShortageNamesTheFirstMeshThatDoesNotFit) {
  const MeshSize size{.vertices = 500'000, .triangles = 1'000'000};
  const auto stl = [&](const char* name) {
    return PlannedMesh{.path = name, .form = {.format = MeshFormat::stl}, .size = size};
  };
  const std::uint64_t each = predict_bytes({.format = MeshFormat::stl}, size).file;
  const PlannedMesh meshes[] = {stl("a.stl"), stl("b.stl"), stl("c.stl")};
  const auto disk = [](std::uint64_t bytes) {
    return [bytes](const std::filesystem::path&) { return bytes; };
  };
  EXPECT_FALSE(find_shortage({}, disk(0)));
  EXPECT_FALSE(find_shortage(meshes, disk(3 * each)));
  const auto last = find_shortage(meshes, disk(3 * each - 1));
  ASSERT_TRUE(last);
  EXPECT_EQ(last->mesh, 2u);
  EXPECT_EQ(last->needed, 3 * each);
  EXPECT_EQ(last->free, 3 * each - 1);
  EXPECT_EQ(find_shortage(meshes, disk(each - 1)).value().mesh, 0u);
}

TEST(Space, WhatIsUncertainNeedsMore) {
  PlannedMesh mesh{.path = "a.ply", .size = {.vertices = 1000, .triangles = 2000}};
  const auto needed = [&] {
    return find_shortage({&mesh, 1}, [](const auto&) { return std::uint64_t{0}; }).value().needed;
  };
  const std::uint64_t sure = needed();
  mesh.uncertainty = 0.25;
  EXPECT_NEAR(static_cast<double>(needed()), 1.25 * static_cast<double>(sure), 1000);
}

TEST(Space, MeshesOfLabelsHaveHeadersAndScratchFilesOfThoseAtATime) {
  const MeshForm ply{.format = MeshFormat::ply};
  const MeshSize size{.vertices = 500'000, .triangles = 1'000'000};
  const auto bytes = [&](std::uint64_t labels, MeshSize largest, int at_a_time) {
    return predict_label_bytes(ply, {}, {labels, size, largest}, at_a_time);
  };
  const MeshBytes whole = predict_bytes(ply, size);
  const MeshSize some{.vertices = 1000, .triangles = 2000};
  EXPECT_EQ(bytes(1, size, 1), whole.needed);
  EXPECT_EQ(bytes(1, size, 8), whole.needed);
  EXPECT_EQ(bytes(100, some, 0), whole.file + 99 * predict_bytes(ply, {}).file);
  EXPECT_EQ(bytes(100, some, 3), bytes(100, some, 0) + 3 * 2000 * 13);
  MeshFilterOptions filter;
  filter.simplify_ratio = 0.5;
  EXPECT_EQ(predict_label_bytes(ply, filter, {100, size, some}, 3),
            bytes(100, some, 3) + 3 * filter_scratch_bytes(filter, some, false));
}

TEST(Progress, LineHasRateAndTimeLeft) {
  EXPECT_EQ(progress_line("convert", 50 << 20, 100 << 20, 2, 80),
            "convert  50% [############............] 25.0 MiB/s, 2 s left");
  EXPECT_EQ(progress_line("convert", 100, 100, 1, 80),
            "convert 100% [########################] 100 B/s");
}

TEST(Progress, UnknownTotalShowsWhatIsDone) {
  EXPECT_EQ(progress_line("read", 2048, 0, 1, 80), "read 2.00 KiB 2.00 KiB/s");
}

TEST(Progress, LinesOfLogsAndObjects) {
  EXPECT_EQ(progress_text("convert", 50 << 20, 100 << 20, 2),
            "convert 50 % (25.0 MiB/s, 2 s left)");
  EXPECT_EQ(progress_text("draw", 2048, 0, 1), "draw 2.00 KiB (2.00 KiB/s)");
  EXPECT_EQ(progress_json("convert", 5, 10, 0.5),
            R"({"progress":{"stage":"convert","done":5,"total":10,"seconds":0.5}})");
  EXPECT_EQ(parse_progress("json"), ProgressForm::json);
  EXPECT_THROW(parse_progress("often"), UsageError);
}

TEST(Parse, StridesAndCounts) {
  EXPECT_EQ(parse_stride("2"), (Int3{2, 2, 2}));
  EXPECT_EQ(parse_stride("1,2,3"), (Int3{1, 2, 3}));
  for (const char* text : {"", "0", "-1", "1,2", "1,0,1", "x"})
    EXPECT_THROW(parse_stride(text), UsageError) << text;
  EXPECT_EQ(parse_count("200000"), 200000u);
  EXPECT_EQ(parse_count("1.5M"), 1500000u);
  EXPECT_EQ(parse_count("3k"), 3000u);
  for (const char* text : {"", "0", "-3", "2T", "M", "1 M", "nan", "inf"})
    EXPECT_THROW(parse_count(text), UsageError) << text;
}

TEST(OutputName, StemOfAnInput) {
  for (const auto& [path, stem] :
       {std::pair{"data/scan.nii.gz", "scan"}, std::pair{"series/", "series"},
        std::pair{"a/scan.h5:/array", "scan_array"}, std::pair{"scan.h5:/run/a", "scan_run_a"},
        std::pair{"x.zarr///", "x"}, std::pair{"raw", "raw"}, std::pair{"a.b.nrrd", "a.b"},
        std::pair{"x.zarr.zip", "x"}})
    EXPECT_EQ(stem_of_input(path), stem) << path;
  EXPECT_EQ(stem_of_input("x.vdb", {.grid = "fog/a"}), "x_fog_a");
  EXPECT_EQ(stem_of_input("x.zarr", {.selection = {.channel = 1, .time = {}}}), "x_c1");
  EXPECT_EQ(stem_of_input("x.tif", {.selection = {.channel = 0, .time = 12}}), "x_c0_t12");
  EXPECT_THROW(stem_of_input("-"), UsageError);
}

TEST(Progress, LineIsCutToTheTerminal) {
  EXPECT_EQ(progress_line("convert", 50, 100, 1, 20).size(), 19u);
}

}  // namespace
}  // namespace isobrick::tools
