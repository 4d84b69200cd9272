#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>

#include "damaged_files.h"
#include "tests/io/bytes/packed.h"
#include "text_volume.h"

// NRRD and MetaImage files with everything that their headers may have.
namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

TEST_F(TextVolume, NrrdAttachedAndPacked) {
  const std::string big = whole(ScalarType::i16, true), little = whole(ScalarType::i16);
  dir.write("raw.nrrd", nrrd("encoding: raw\nendian: big\n\n") + big);
  dir.write("gzip.nrrd", nrrd("encoding: gzip\nendian: little\n\n") + gzip(little));
  dir.write("members.nrrd", nrrd("encoding: gz\nendian: little\n\n") + gzip(little.substr(0, 99)) +
                                gzip(little.substr(99)) + std::string(512, '\0'));
  dir.write("content", nrrd("encoding: gzip\nendian: big\nbyte skip: 3\n\n") + gzip("abc" + big));
  dir.write("v.raw.gz", gzip(little));
  dir.write("v.nhdr", nrrd("encoding: gzip\nendian: little\ndata file: v.raw.gz\n"));
  for (const char* name : {"raw.nrrd", "gzip.nrrd", "members.nrrd", "content", "v.nhdr"})
    expect_whole(name);
  EXPECT_TRUE(open_source(dir / "raw.nrrd", {})->random_access());
  const auto packed = open_source(dir / "gzip.nrrd", {});
  EXPECT_FALSE(packed->random_access());
  EXPECT_GT(packed->memory(), 32768u);
  EXPECT_LT(packed->memory(), 1u << 20);
}

TEST_F(TextVolume, NrrdInSeveralFiles) {
  const std::string all = whole(ScalarType::i16);
  const std::size_t plane = all.size() / 4;
  for (int z = 0; z < 4; ++z)
    dir.write(std::string("s").append(std::to_string(z + 8)).append(".raw"),
              "#\n" + all.substr(static_cast<std::size_t>(z) * plane, plane));
  const std::string common = nrrd("encoding: raw\nendian: little\nline skip: 1\n");
  dir.write("list.nhdr", common + "data file: LIST\ns8.raw\ns9.raw\ns10.raw\ns11.raw\n");
  expect_whole("list.nhdr");
  dir.write("pattern.nhdr", common + "data file: s%d.raw 8 11 1\n");
  expect_whole("pattern.nhdr");
  for (const char* subdim : {"1", "2", "3"}) {
    dir.write("pattern.nhdr", common + "data file: s%d.raw 8 11 1 " + subdim + "\n");
    expect_whole("pattern.nhdr");
    dir.write("list.nhdr",
              common + "data file: LIST " + subdim + "\ns8.raw\ns9.raw\ns10.raw\ns11.raw\n");
    expect_whole("list.nhdr");
  }
  for (const char* subdim : {"0", "4", "-1", "x"}) {
    dir.write("bad.nhdr", common + "data file: s%d.raw 8 11 1 " + subdim + "\n");
    EXPECT_TRUE(contains(message_of([&] { open_source(dir / "bad.nhdr", {}); }), "data file"));
    dir.write("bad.nhdr", common + "data file: LIST " + subdim + "\ns8.raw\n");
    EXPECT_TRUE(contains(message_of([&] { open_source(dir / "bad.nhdr", {}); }), "data file"));
  }
  dir.write("three.nhdr", common + "data file: s%d.raw 8 10\n");
  EXPECT_TRUE(contains(message_of([&] { open_source(dir / "three.nhdr", {}); }), "at most 210"));
  dir.write("five.nhdr", common + "data file: LIST\ns8.raw\ns9.raw\ns10.raw\ns11.raw\ns11.raw\n");
  EXPECT_TRUE(contains(message_of([&] { open_and_read("five.nhdr"); }), "goes on"));
  dir.write("s9.raw", "#\n" + all.substr(plane, plane - 2));
  EXPECT_TRUE(contains(message_of([&] { open_and_read("list.nhdr"); }), "s9.raw"));
  for (const char* pattern :
       {"s%s.raw 1 2", "s%d.raw 1", "s%d.raw 2 1", "s%d.raw 1 2 -1", "s%d.raw 1 2 0",
        "s%d.raw 1 2 1 2 3", "s%d%d.raw 1 2", "s%9999d.raw 1 2", "s%999d.raw 1 2", "s%021d.raw 1 2",
        "s%d.raw 0 9223372036854775807", "s%d.raw 0 1000000"}) {
    dir.write("bad.nhdr", common + "data file: " + pattern + "\n");
    message_of([&] { open_source(dir / "bad.nhdr", {}); });
  }
}

TEST_F(TextVolume, NrrdInFilesWhoseNumbersFall) {
  const std::string all = whole(ScalarType::i16);
  const std::size_t plane = all.size() / 4;
  for (std::size_t z = 0; z < 4; ++z)
    dir.write(std::string("s").append(std::to_string(20 - 5 * z)).append(".raw"),
              all.substr(z * plane, plane));
  const std::string common = nrrd("encoding: raw\nendian: little\n");
  for (const char* numbers : {"20 5 -5", "20 4 -5", "20 5 -5 2"}) {
    dir.write("v.nhdr", common + "data file: s%d.raw " + numbers + "\n");
    expect_whole("v.nhdr");
  }
}

/// The last number is the largest there is: nothing comes after it.
TEST_F(TextVolume, PatternsOfHugeNumbersEnd) {
  const std::string all = whole(ScalarType::i16);
  const std::string last = "9223372036854775807", before = "6917529027641081856";
  dir.write("s" + before + ".raw", all.substr(0, all.size() / 2));
  dir.write("s0" + last + ".raw", all.substr(all.size() / 2));
  fs::rename(dir / ("s" + before + ".raw"), dir / ("s0" + before + ".raw"));
  dir.write("v.nhdr", nrrd("encoding: raw\nendian: little\ndata file: s%020d.raw " + before + " " +
                           last + " 2305843009213693951\n"));
  expect_whole("v.nhdr");
}

TEST_F(TextVolume, TextInSeveralFilesIsNotOneText) {
  dir.write("a.txt", "1 2 3 12");
  dir.write("b.txt", "34 5 6\n7\n");
  dir.write("v.nhdr",
            "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: text\n"
            "data file: LIST\na.txt\nb.txt\n");
  EXPECT_EQ(open_and_read("v.nhdr"), std::string({1, 2, 3, 12, 34, 5, 6, 7}));
  dir.write("b.txt", "34 5 6");
  EXPECT_TRUE(contains(message_of([&] { open_and_read("v.nhdr"); }), "b.txt"));
}

TEST_F(TextVolume, NrrdAsText) {
  dir.write("v.nrrd",
            "NRRD0001\ntype: float\ndimension: 3\nsizes: 2 2 2\nencoding: ascii\n\n"
            "1 -2.5e1\n+3 nan\r\n  0.125 inf 1e300 7");
  const auto bytes = open_and_read("v.nrrd");
  std::array<float, 8> v{};
  ASSERT_EQ(bytes.size(), sizeof(v));
  std::memcpy(v.data(), bytes.data(), sizeof(v));
  EXPECT_EQ(v[0], 1);
  EXPECT_EQ(v[1], -25);
  EXPECT_EQ(v[2], 3);
  EXPECT_TRUE(v[3] != v[3]);
  EXPECT_EQ(v[4], 0.125f);
  EXPECT_EQ(v[5], std::numeric_limits<float>::infinity());
  EXPECT_EQ(v[6], std::numeric_limits<float>::infinity());
  EXPECT_EQ(v[7], 7);
  dir.write("c.nrrd",
            "NRRD0001\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: text\n\n"
            "1, 2,3 ,4\n5,6,7,8,\n");
  EXPECT_EQ(open_and_read("c.nrrd"), std::string({1, 2, 3, 4, 5, 6, 7, 8}));
  dir.write("d.nrrd",
            "NRRD0001\ntype: double\ndimension: 3\nsizes: 2 2 2\nencoding: ascii\n\n"
            "1e400 -1e400 1e-400 -1e-400 1e308 5e-324 0 -0");
  const std::string wide = open_and_read("d.nrrd");
  std::array<double, 8> w{};
  ASSERT_EQ(wide.size(), sizeof(w));
  std::memcpy(w.data(), wide.data(), sizeof(w));
  constexpr double infinite = std::numeric_limits<double>::infinity();
  EXPECT_EQ(w, (std::array<double, 8>{infinite, -infinite, 0, 0, 1e308, 5e-324, 0, 0}));
  EXPECT_TRUE(std::signbit(w[3]) && std::signbit(w[7]) && !std::signbit(w[2]));
  const std::string header =
      "NRRD0001\ntype: uchar\ndimension: 3\nsizes: 2 2 1\nencoding: text\n\n";
  dir.write("w.nrrd", header + "1 2 3 256");
  EXPECT_TRUE(contains(message_of<Error>([&] { open_and_read("w.nrrd"); }), "'256'"));
  dir.write("w.nrrd", header + "1 2 3 4 5");
  EXPECT_EQ(open_and_read("w.nrrd"), std::string({1, 2, 3, 4}));
  dir.write("w.nrrd", header + "1 2");
  EXPECT_TRUE(contains(message_of([&] { open_and_read("w.nrrd"); }), "at most 2"));
  dir.write("w.nrrd", header + std::string(100000, '1'));
  message_of<Error>([&] { open_and_read("w.nrrd"); });
}

/// Channels first (fastest) and times last.
TEST_F(TextVolume, ChannelsAndTimes) {
  const Int3 e{3, 2, 2};
  std::string all;
  std::array<std::array<std::string, 2>, 3> volumes;
  for (std::size_t t = 0; t < 2; ++t)
    for (std::size_t i = 0; i < 12; ++i)
      for (std::size_t c = 0; c < 3; ++c) {
        const char v = static_cast<char>(i + 20 * c + 100 * t);
        all += v;
        volumes[c][t] += v;
      }
  const std::string sizes = "NRRD0004\ntype: uchar\ndimension: 5\nsizes: 3 3 2 2 2\n";
  const std::string kinds = "kinds: vector domain domain domain time\n";
  dir.write("raw.nrrd", sizes + kinds + "encoding: raw\n\n" + all);
  dir.write("gzip.nrrd", sizes + kinds + "encoding: gzip\n\n" + gzip(all));
  dir.write("v.mha",
            "NDims = 4\nDimSize = 3 2 2 2\nElementNumberOfChannels = 3\n"
            "ElementSpacing = 2 3 4 1\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n" +
                all);
  for (const char* name : {"raw.nrrd", "gzip.nrrd", "v.mha"}) {
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t t = 0; t < 2; ++t) {
        VolumeRequest request;
        request.selection = {static_cast<Index>(c), static_cast<Index>(t)};
        EXPECT_EQ(open_and_read(name, request), volumes[c][t]) << name;
        EXPECT_EQ(open_source(dir / name, request)->info().extent, e);
      }
    VolumeRequest request;
    EXPECT_TRUE(contains(message_of([&] { open_source(dir / name, request); }),
                         "3 channels: choose one with --channel 0 … 2"));
    request.selection.channel = 3;
    EXPECT_TRUE(contains(message_of([&] { open_source(dir / name, request); }), "--channel 3"));
    request.selection.channel = 1;
    EXPECT_TRUE(contains(message_of([&] { open_source(dir / name, request); }),
                         "2 times: choose one with --time 0 … 1"));
  }
  VolumeRequest request;
  request.selection.time = 1;
  dir.write("v.nrrd", nrrd("encoding: raw\nendian: little\n\n") + whole(ScalarType::i16));
  EXPECT_TRUE(contains(message_of([&] { open_source(dir / "v.nrrd", request); }), "1 time:"));
  // Without kinds the request itself decides which axis is not space.
  dir.write("w.nrrd", "NRRD0004\ntype: uchar\ndimension: 4\nsizes: 3 2 2 2\nencoding: raw\n\n" +
                          all.substr(0, 24));
  EXPECT_EQ(open_and_read("w.nrrd", request), all.substr(12, 12));
}

TEST_F(TextVolume, MetaImageLocalPackedAndListed) {
  const std::string big = whole(ScalarType::i16, true);
  const std::string common =
      "ObjectType = Image\nNDims = 3\nElementByteOrderMSB = True\n"
      "DimSize = 7 5 4\nElementType = MET_SHORT\n";
  dir.write("local.mha", common + "ElementDataFile = LOCAL\n" + big);
  dir.write("zlib.mha",
            common + "CompressedData = True\nElementDataFile = LOCAL\n" + pack(big, false));
  dir.write("gzip.mha", common + "CompressedData = True\nElementDataFile = LOCAL\n" + gzip(big));
  dir.write("v.zraw", pack(big, false));
  dir.write("v.mhd", common + "CompressedData = True\nElementDataFile = v.zraw\n");
  dir.write("low.raw", big.substr(0, big.size() / 2));
  dir.write("high.raw", big.substr(big.size() / 2));
  dir.write("list.mhd", common + "ElementDataFile = LIST\nlow.raw\nhigh.raw\n");
  for (const char* name : {"local.mha", "zlib.mha", "gzip.mha", "v.mhd", "list.mhd"})
    expect_whole(name);
  std::string text;
  for (int i = 0; i < 140; ++i) text += std::to_string(i - 70) + (i % 7 == 6 ? "\n" : " ");
  dir.write("text.mha", common + "BinaryData = False\nElementDataFile = LOCAL\n" + text);
  const std::string read = open_and_read("text.mha");
  std::int16_t first;
  std::memcpy(&first, read.data(), sizeof(first));
  EXPECT_EQ(first, -70);
}

TEST_F(TextVolume, DamagedCompression) {
  const std::string head = nrrd("encoding: gzip\nendian: little\n\n");
  const std::string packed = gzip(whole(ScalarType::i16));
  const auto refused = [&](const std::string& bytes) {
    dir.write("v.nrrd", head + bytes);
    try {
      open_and_read("v.nrrd");
    } catch (const Error& error) {
      EXPECT_TRUE(contains(error.what(), "v.nrrd")) << error.what();
      return;
    }
    ADD_FAILURE() << "read although damaged";
  };
  for (std::size_t size = 0; size < packed.size(); ++size) refused(packed.substr(0, size));
  std::string wrong = packed;
  wrong[packed.size() - 6] ^= 1;  // in the checksum
  refused(wrong);
  for (std::size_t i = 10; i < packed.size(); ++i) {
    wrong = packed;
    wrong[i] ^= 0x55;
    refused(wrong);
  }
}

TEST_F(TextVolume, ABombIsNotUnpacked) {
  const std::string bomb = gzip(std::string(64 << 20, '\0'), 9);
  dir.write("small.nrrd", nrrd("encoding: gzip\nendian: little\n\n") + bomb);
  const auto small = open_source(dir / "small.nrrd", {});
  read_all(*small);
  ASSERT_EQ(small->notes().size(), 1u);
  EXPECT_TRUE(contains(small->notes()[0], "at least 1048576 bytes after the samples are ignored"));
  const std::string header = "NRRD0004\ntype: uchar\ndimension: 3\nencoding: gzip\n";
  dir.write("large.nrrd", header + "sizes: 1000000 1000000 100000\n\n" + bomb);
  EXPECT_TRUE(contains(message_of([&] { open_source(dir / "large.nrrd", {}); }), "at most"));
  dir.write("skip.nrrd", header + "sizes: 2 2 2\nbyte skip: 9000000000000000000\n\n" + bomb);
  EXPECT_TRUE(contains(message_of([&] { open_source(dir / "skip.nrrd", {}); }), "to skip"));
}

TEST_F(TextVolume, WhatTheFileSaysItselfIsNotSaidAgain) {
  dir.write("v.nrrd", nrrd("encoding: gzip\nendian: little\n\n") + gzip(whole(ScalarType::i16)));
  VolumeRequest request;
  request.type = ScalarType::u16;
  EXPECT_TRUE(contains(message_of([&] { open_source(dir / "v.nrrd", request); }), "--type"));
  request.type.reset();
  const std::string head = nrrd("encoding: raw\nendian: little\n");
  dir.write("v.raw", whole(ScalarType::i16) + "!!");
  dir.write("apart.nhdr", head + "data file: v.raw\n");
  dir.write("raw.nrrd", head + "\n" + whole(ScalarType::i16) + "!!");
  dir.write("v.mhd",
            "NDims = 3\nDimSize = 7 5 4\nElementType = MET_SHORT\nElementDataFile = v.raw\n");
  request.offset = 2;
  for (const char* name : {"v.nrrd", "apart.nhdr", "raw.nrrd", "v.mhd"})
    EXPECT_TRUE(contains(message_of<UsageError>([&] { open_source(dir / name, request); }),
                         "leave --offset out"))
        << name;
  request.offset.reset();
  request.spacing = Vec3d{1, 2, 3};
  EXPECT_EQ(open_source(dir / "v.nrrd", request)->info().transform.spacing, (Vec3d{1, 2, 3}));
}

TEST_F(TextVolume, AxesThatFewDigitsLeftAskewAreSquare) {
  dir.write("v.nrrd", nrrd("space dimension: 3\nspace directions: (1,0.0005,0) (0,1,0) (0,0,2)\n"
                           "encoding: raw\nendian: little\n\n") +
                          whole(ScalarType::i16));
  const Transform t = open_source(dir / "v.nrrd", {})->info().transform;
  const auto& d = t.direction;
  EXPECT_NEAR(d[0] * d[1] + d[3] * d[4] + d[6] * d[7], 0, 1e-15);
  EXPECT_NEAR(d[3], 0.0005, 1e-9);
}

TEST_F(TextVolume, Mutations) {
  const std::string samples = whole(ScalarType::i16);
  const std::string about =
      "space: right-anterior-superior\nspace directions: (1,0,0) (0,2,0) (0,0,3)\n"
      "space units: \"mm\" \"mm\" \"mm\"\nkinds: domain domain domain\nendian: little\n";
  expect_mutations_are_no_crash(dir, "m.nrrd", nrrd(about + "encoding: raw\n\n") + samples);
  expect_mutations_are_no_crash(dir, "m.nrrd", nrrd(about + "encoding: gzip\n\n") + gzip(samples));
  const std::string meta =
      "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
      "DimSize = 7 5 4\nElementSpacing = 1 2 3\nElementType = MET_SHORT\n";
  expect_mutations_are_no_crash(dir, "m.mha", meta + "ElementDataFile = LOCAL\n" + samples);
  expect_mutations_are_no_crash(
      dir, "m.mha",
      meta + "CompressedData = True\nElementDataFile = LOCAL\n" + pack(samples, false));
}

}  // namespace
}  // namespace isobrick
