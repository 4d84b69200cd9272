#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "tests/tools/program.h"
#include "tests/viewer/render/picture_difference.h"
#include "viewer/render/gl_context.h"

namespace isobrick::test {
namespace {

Arguments operator+(Arguments a, const Arguments& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

/// Compares pictures that the program draws with those in tests/viewer/render/pictures, which were
/// checked by eye. ISOBRICK_KEEP_PICTURES=1 in the environment stores new ones.
class StoredPictures : public ProgramTest {
 protected:
  void SetUp() override {
    if (!GlContext::available()) GTEST_SKIP() << "no OpenGL 4.5 without a window here";
  }

  /// A field of 96 × 80 × 64 samples.
  std::string volume(const std::string& kind, const Arguments& more = {}) {
    const std::string store = path(kind + ".zarr");
    if (!std::filesystem::exists(store))
      run_json(Arguments{"synth", kind, store, "--dims", "96,80,64", "--type", "u8"} + more);
    return store;
  }

  PngPicture view(const std::string& store, const Arguments& options) {
    run_json(
        Arguments{"view", store, "--screenshot", path("seen.png"), "--size", "320x240", "--force"} +
        options);
    return read_png(path("seen.png"));
  }
  PngPicture render(const Arguments& arguments) {
    run_json(Arguments{"render", "-o", path("seen.png"), "--size", "320x240", "--force"} +
             arguments);
    return read_png(path("seen.png"));
  }

  /// A surface in a PLY with a unit, which synthetic volumes lack.
  static void write_millimetres(const std::string& store, const std::string& mesh) {
    run_json({"extract", store, "--isovalue", "127.5", "-o", mesh});
    std::string bytes = read_file(mesh);
    write_file(mesh, bytes.insert(bytes.find("element vertex"), "comment unit millimeter\n"));
  }

  static std::string stored(const std::string& name) {
    return std::string(ISOBRICK_PICTURES) + "/" + name + ".png";
  }

  /// Compares the last picture.
  void expect_stored(const std::string& name, const PngPicture& picture) {
    if (std::getenv("ISOBRICK_KEEP_PICTURES") != nullptr) {
      std::filesystem::copy_file(path("seen.png"), stored(name),
                                 std::filesystem::copy_options::overwrite_existing);
      return;
    }
    const PngPicture expected = read_png(stored(name));
    ASSERT_EQ(picture.width, expected.width);
    ASSERT_EQ(picture.height, expected.height);
    const PictureDifference d = difference(picture, expected);
    EXPECT_TRUE(d.tolerable()) << name << " looks different: by " << d.mean << " in the mean, and "
                               << 100 * d.share << " % of it by more than "
                               << PictureDifference::kNoticed;
  }
};

TEST_F(StoredPictures, ASurface) {
  expect_stored("surface", view(volume("gyroid"), {"--isovalue", "127.5"}));
}

TEST_F(StoredPictures, OneSurfaceThroughAnother) {
  expect_stored("transparent", view(volume("sphere"), {"--isovalue", "90", "--opacity", "0.35",
                                                       "--isovalue", "170"}));
}

TEST_F(StoredPictures, APlaneCutsAndASliceShows) {
  expect_stored("plane_and_slice", view(volume("gyroid"), {"--isovalue", "127.5", "--clip",
                                                           "1,-1.5,0.3,10", "--slice", "z:0.3"}));
}

TEST_F(StoredPictures, EdgesAndOcclusion) {
  expect_stored("edges", view(volume("mixing"), {"--isovalue", "128", "--edges", "--plain"}));
}

TEST_F(StoredPictures, ParallelRaysAndAScaleBar) {
  expect_stored("orthographic",
                view(volume("gyroid"), {"--isovalue", "150", "--camera",
                                        "orthographic,azimuth=-35,elevation=30,zoom=1.3",
                                        "--colour", "#8fb0d8", "--no-occlusion"}));
}

TEST_F(StoredPictures, MeshFiles) {
  for (const char* kind : {"gyroid", "sphere"})
    write_millimetres(volume(kind), path(kind + std::string(".ply")));
  expect_stored("meshes",
                render({path("gyroid.ply"), path("sphere.ply"), "--opacity", "1", "--opacity",
                        "0.4", "--clip", "-1,0.4,0,-60", "--region", "4:90,0:80,0:50", "--axes",
                        "--box", "--scale-bar", "mm", "--background", "white,#c8d0d8"}));
}

TEST_F(StoredPictures, WhatLooksDifferentIsNotTolerated) {
  const std::string store = volume("gyroid");
  const PngPicture right = view(store, {"--isovalue", "127.5"});
  const auto expect_noticed = [&](const PngPicture& other, const char* what) {
    const PictureDifference d = difference(right, other);
    EXPECT_FALSE(d.tolerable()) << what << ": " << d.mean << ", " << d.share;
  };
  expect_noticed(view(store, {"--isovalue", "131"}), "an isovalue");
  expect_noticed(view(store, {"--isovalue", "127.5", "--colour", "#dec0b2"}), "a colour");
  expect_noticed(view(store, {"--isovalue", "127.5", "--no-occlusion"}), "no occlusion");
  expect_noticed(view(store, {"--isovalue", "127.5", "--camera", "azimuth=31"}), "a camera");
  // The light 3 % weaker.
  PngPicture darker = right;
  for (std::uint8_t& v : darker.rgb) {
    const double linear = std::pow(v / 255.0, 2.2) * 0.97;
    v = static_cast<std::uint8_t>(std::lround(255 * std::pow(linear, 1 / 2.2)));
  }
  expect_noticed(darker, "a light");
}

TEST_F(StoredPictures, WhatDriversDifferByIsTolerated) {
  const PngPicture picture = view(volume("gyroid"), {"--isovalue", "127.5"});
  EXPECT_EQ(difference(picture, picture).mean, 0);
  // Each colour rounded differently, and edges smoothed by half a pixel more.
  PngPicture other = picture;
  for (int y = 0; y < picture.height; ++y)
    for (int x = 1; x < picture.width; ++x)
      for (int c = 0; c < 3; ++c) {
        const int here = picture.at(x, y)[c], left = picture.at(x - 1, y)[c];
        const int mixed = (7 * here + left + 4) / 8 + ((x + y) % 2 != 0 ? 1 : 0);
        other.rgb[static_cast<std::size_t>(3 * (y * picture.width + x) + c)] =
            static_cast<std::uint8_t>(std::min(mixed, 255));
      }
  const PictureDifference d = difference(picture, other);
  EXPECT_TRUE(d.tolerable()) << d.mean << ", " << d.share;
}

}  // namespace
}  // namespace isobrick::test
