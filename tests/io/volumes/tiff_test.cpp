#include <gtest/gtest.h>
#include <tiffio.h>

#include <filesystem>
#include <memory>
#include <thread>

#include <isobrick/open_source.h>
#include "damaged_files.h"

namespace isobrick::inline v0 {
namespace {

constexpr Int3 kExtent{19, 17, 5};
constexpr Box3 kWhole{{0, 0, 0}, kExtent};

/// How a stack is written.
struct Layout {
  const char* mode = "w";  ///< of libtiff: 8 BigTIFF, b or l the byte order
  bool tiled = false;
  std::uint16_t compression = COMPRESSION_NONE;
  std::string description = {};
};

class Tiff : public ::testing::Test {
 protected:
  /// Planes [z0, z1) of samples of i16.
  std::string write(const std::string& name, const Layout& layout, Index z0 = 0,
                    Index z1 = kExtent.z) const {
    TIFF* file = TIFFOpen((dir / name).c_str(), layout.mode);
    for (Index z = z0; z < z1; ++z) {
      TIFFSetField(file, TIFFTAG_IMAGEWIDTH, static_cast<std::uint32_t>(kExtent.x));
      TIFFSetField(file, TIFFTAG_IMAGELENGTH, static_cast<std::uint32_t>(kExtent.y));
      TIFFSetField(file, TIFFTAG_BITSPERSAMPLE, 16);
      TIFFSetField(file, TIFFTAG_SAMPLESPERPIXEL, 1);
      TIFFSetField(file, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_INT);
      TIFFSetField(file, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
      TIFFSetField(file, TIFFTAG_COMPRESSION, layout.compression);
      if (!layout.description.empty())
        TIFFSetField(file, TIFFTAG_IMAGEDESCRIPTION, layout.description.c_str());
      const Box3 plane{{0, 0, z}, {kExtent.x, kExtent.y, z + 1}};
      std::string samples = sample_bytes(ScalarType::i16, plane, kExtent);
      if (layout.tiled)
        write_tiles(file, samples);
      else
        write_strips(file, samples);
      TIFFWriteDirectory(file);
    }
    TIFFClose(file);
    return dir / name;
  }

  TempDir dir;

 private:
  static void write_strips(TIFF* file, std::string& samples) {
    constexpr std::uint32_t rows = 3;
    TIFFSetField(file, TIFFTAG_ROWSPERSTRIP, rows);
    const std::size_t strip = rows * 2 * static_cast<std::size_t>(kExtent.x);
    for (std::uint32_t i = 0; i * strip < samples.size(); ++i)
      TIFFWriteEncodedStrip(file, i, samples.data() + i * strip,
                            static_cast<tmsize_t>(std::min(strip, samples.size() - i * strip)));
  }
  static void write_tiles(TIFF* file, const std::string& samples) {
    constexpr std::size_t edge = 16;
    TIFFSetField(file, TIFFTAG_TILEWIDTH, static_cast<std::uint32_t>(edge));
    TIFFSetField(file, TIFFTAG_TILELENGTH, static_cast<std::uint32_t>(edge));
    const auto nx = static_cast<std::size_t>(kExtent.x), ny = static_cast<std::size_t>(kExtent.y);
    for (std::size_t y = 0; y < ny; y += edge)
      for (std::size_t x = 0; x < nx; x += edge) {
        std::string tile(2 * edge * edge, '\0');
        for (std::size_t r = 0; r < std::min(edge, ny - y); ++r)
          samples.copy(&tile[2 * r * edge], 2 * std::min(edge, nx - x), 2 * ((y + r) * nx + x));
        TIFFWriteTile(file, tile.data(), static_cast<std::uint32_t>(x),
                      static_cast<std::uint32_t>(y), 0, 0);
      }
  }
};

TEST_F(Tiff, StripsAndTilesOfBothOrdersAndSizes) {
  const Box3 inner{{3, 2, 1}, {17, 16, 4}};
  for (const char* mode : {"wl", "wb", "wl8", "wb8"})
    for (const bool tiled : {false, true})
      for (const int compression :
           {COMPRESSION_NONE, COMPRESSION_LZW, COMPRESSION_ADOBE_DEFLATE, COMPRESSION_PACKBITS}) {
        const auto source =
            open_source(write("v", {mode, tiled, static_cast<std::uint16_t>(compression)}), {});
        EXPECT_TRUE(source->random_access() && source->parallel());
        EXPECT_EQ(source->info().type, ScalarType::i16);
        ASSERT_EQ(source->info().extent, kExtent);
        EXPECT_EQ(read_box(*source, kWhole), sample_bytes(ScalarType::i16, kWhole, kExtent));
        EXPECT_EQ(read_box(*source, inner), sample_bytes(ScalarType::i16, inner, kExtent));
      }
}

TEST_F(Tiff, ThreadsReadAtOnce) {
  const auto source = open_source(write("v.tif", {"w", true, COMPRESSION_LZW}), {});
  std::vector<std::thread> threads;
  for (int t = 0; t < 8; ++t)
    threads.emplace_back([&, t] {
      for (int i = 0; i < 20; ++i) {
        const Box3 plane{{0, 0, (t + i) % 5}, {kExtent.x, kExtent.y, (t + i) % 5 + 1}};
        EXPECT_EQ(read_box(*source, plane), sample_bytes(ScalarType::i16, plane, kExtent));
      }
    });
  for (auto& thread : threads) thread.join();
}

TEST_F(Tiff, AFolderInTheOrderOfNumbers) {
  const char* names[] = {"a2.tif", "a9.tif", "a10.tif", "a011.tif", "b1.tif"};
  for (Index z = 0; z < 5; ++z) write(names[z], {}, z, z + 1);
  dir.write("Thumbs.db", "no picture");
  dir.write(".hidden.tif", "no picture");
  const auto source = open_source(dir / ".", {});
  EXPECT_EQ(read_box(*source, kWhole), sample_bytes(ScalarType::i16, kWhole, kExtent));
  dir.write("a3.tif", "broken");
  // Neither its content nor, therefore, its place in the stack is known.
  EXPECT_TRUE(contains(message_of<Error>([&] { open_source(dir / ".", {}); }), "a3.tif"));
}

TEST_F(Tiff, WhatDescriptionsPromiseMustBeThere) {
  const auto refused = [&](const std::string& description) {
    const auto path = write("v.tif", {.description = description});
    return message_of([&] { open_source(path, {}); });
  };
  EXPECT_TRUE(contains(refused("ImageJ=1.54\nimages=6\nchannels=2\nslices=3\n"), "promises 6"));
  EXPECT_TRUE(contains(refused("ImageJ=1.54\nimages=5\nchannels=5\nslices=1\n"), "5 channels"));
  EXPECT_TRUE(contains(refused("ImageJ=1.54\nchannels=-1\n"), "no sense"));
  EXPECT_TRUE(contains(refused("ImageJ=1.54\nslices=9223372036854775808\n"), "too large"));
  EXPECT_TRUE(contains(refused("<OME><Pixels DimensionOrder=\"XYZCT\" SizeZ=\"1\" SizeC=\"5\">"),
                       "5 chan"));
  EXPECT_TRUE(contains(refused("<OME><Pixels DimensionOrder=\"XYQ\" SizeZ=\"5\">"), "Order"));
  // 2^66 pages in all, which are 0 where the product wraps around.
  EXPECT_TRUE(contains(refused("ImageJ=1.54\nchannels=4194304\nslices=4194304\nframes=4194304\n"),
                       "no sense"));
  const auto one = write("one.tif", {.description = "ImageJ=1.54\nimages=9\nslices=9\n"}, 0, 1);
  EXPECT_TRUE(contains(message_of([&] { open_source(one, {}); }), "promises samples"));
  const auto spaced =
      write("s.tif", {.description = "ImageJ=1.54\nimages=5\nslices=5\nspacing=2.5\n"
                                     "unit=nm\n"});
  EXPECT_EQ(open_source(spaced, {})->info().transform.spacing, (Vec3d{1, 1, 2.5}));
  EXPECT_EQ(open_source(spaced, {})->info().transform.unit, "nanometer");
}

TEST_F(Tiff, EachAxisOfOmeHasAUnitOfItsOwn) {
  const auto transform = [&](const std::string& sizes) {
    const auto path =
        write("v.tif", {.description = "<OME><Pixels DimensionOrder=\"XYZCT\" SizeZ=\"5\" " +
                                       sizes + "></Pixels></OME>"});
    return open_source(path, {})->info().transform;
  };
  const Transform mixed = transform(
      "PhysicalSizeX=\"250\" PhysicalSizeXUnit=\"nm\" PhysicalSizeY=\"0.25\" "
      "PhysicalSizeZ=\"0.0015\" PhysicalSizeZUnit=\"mm\"");
  EXPECT_EQ(mixed.unit, "nanometer");
  EXPECT_EQ(mixed.spacing, (Vec3d{250, 250, 1500}));
  const Transform depth = transform("PhysicalSizeZ=\"3\" PhysicalSizeZUnit=\"Å\"");
  EXPECT_EQ(depth.unit, "angstrom");
  EXPECT_EQ(depth.spacing, (Vec3d{1, 1, 3}));
  const Transform pixels = transform(
      "PhysicalSizeX=\"2\" PhysicalSizeXUnit=\"pixel\" PhysicalSizeY=\"3\" "
      "PhysicalSizeYUnit=\"pixel\"");
  EXPECT_EQ(pixels.unit, "");
  EXPECT_EQ(pixels.spacing, (Vec3d{2, 3, 1}));
  EXPECT_TRUE(contains(message_of([&] {
                         transform(
                             "PhysicalSizeX=\"2\" PhysicalSizeXUnit=\"pixel\" "
                             "PhysicalSizeY=\"3\"");
                       }),
                       "PhysicalSizeY is in units of"));
}

TEST_F(Tiff, DamagedFiles) {
  for (const Layout& layout : {Layout{"wl", false, COMPRESSION_LZW}, Layout{"wb8", true}})
    expect_damage_is_no_crash(
        dir, "d.tif",
        dir.read(std::filesystem::path(write("v.tif", layout, 0, 2)).filename().string()), 7);
}

TEST_F(Tiff, Mutations) {
  for (const Layout& layout :
       {Layout{"wl", true, COMPRESSION_ADOBE_DEFLATE}, Layout{"wb8", false, COMPRESSION_NONE}})
    expect_mutations_are_no_crash(
        dir, "m.tif",
        dir.read(std::filesystem::path(write("v.tif", layout, 0, 2)).filename().string()));
}

}  // namespace
}  // namespace isobrick
