#include <gtest/gtest.h>

#include <filesystem>
#include <thread>

#include <isobrick/error.h>
#include "tests/io/bytes/temp_dir.h"
#include "tests/io/meshes/test_meshes.h"
#include "tests/viewer/render/pictures.h"
#include "viewer/render/camera_request.h"

namespace isobrick::inline v0 {
namespace {

std::size_t open_files() {
  std::size_t count = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator("/proc/self/fd"))
    ++count;
  return count;
}

class Context : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!GlContext::available()) GTEST_SKIP() << "no OpenGL 4.5 without a window here";
  }
};

TEST_F(Context, FiftyLeaveNothingOpen) {
  const std::size_t before = open_files();
  for (int i = 0; i < 50; ++i) {
    const GlContext context;
    EXPECT_FALSE(current_gl_device().renderer.empty());
  }
  EXPECT_LE(open_files(), before + 1);
}

TEST_F(Context, TwoLiveBesideEachOther) {
  GlContext first;
  { const GlContext second; }
  first.make_current();
  EXPECT_FALSE(current_gl_device().version.empty());
}

TEST_F(Context, MovesToAnotherThread) {
  GlContext context;
  context.release_current();
  std::thread([&] {
    context.make_current();
    EXPECT_FALSE(current_gl_device().version.empty());
    context.release_current();
  }).join();
}

TEST_F(Context, SizesAndPlanesAreChecked) {
  const GlContext context;
  Renderer renderer;
  EXPECT_THROW(renderer.begin({}, 0, 10, {}), UsageError);
  EXPECT_THROW(renderer.begin({}, 1 << 24, 10, {}), UsageError);
  PictureSettings settings;
  settings.planes.resize(13);
  EXPECT_THROW(renderer.begin({}, 16, 16, settings), UsageError);
}

TEST_F(Context, APoolReusesItsRoom) {
  const GlContext context;
  MeshPool pool(4096);
  const TestMesh ball = make_ball({0, 0, 0}, 1, 20);
  std::vector<PooledMesh> meshes;
  for (int i = 0; i < 4; ++i) meshes.push_back(pool.add(ball.chunk()));
  const std::uint64_t all = pool.bytes(), room = pool.capacity();
  EXPECT_EQ(all, 4 * meshes[0].bytes());
  for (int round = 0; round < 20; ++round) {
    meshes[static_cast<std::size_t>(round % 4)].reset();
    meshes[static_cast<std::size_t>(round % 4)] = pool.add(ball.chunk());
  }
  EXPECT_EQ(pool.bytes(), all);
  EXPECT_EQ(pool.capacity(), room);
  meshes.clear();
  EXPECT_EQ(pool.bytes(), 0u);
  TestMesh wrong = ball;
  wrong.triangles[5][1] = 1 << 20;
  EXPECT_THROW(pool.add(wrong.chunk()), Error);
}

TEST(CameraText, Parts) {
  const CameraRequest request =
      parse_camera("azimuth=90,elevation=0,zoom=2,fov=40,orthographic,up=0:0:1");
  const Camera camera = make_camera(request, {-1, -1, -1}, {1, 1, 1}, 1);
  EXPECT_NEAR(camera.back.x, 1, 1e-12);
  EXPECT_TRUE(camera.orthographic);
  EXPECT_NEAR(camera.extent_at(1), 1 / 0.92, 1e-9);  // half of 2 / 0.92
  const Camera placed =
      make_camera(parse_camera("eye=5:0:0,target=0:1:0"), {-1, -1, -1}, {1, 1, 1}, 1);
  EXPECT_EQ(placed.eye, (Vec3d{5, 0, 0}));
  EXPECT_EQ(placed.target, (Vec3d{0, 1, 0}));
}

TEST(CameraText, NonsenseIsRefused) {
  for (const char* text :
       {"", "azimut=3", "azimuth", "azimuth=x", "zoom=0", "zoom=-1", "fov=180", "up=0:0:0",
        "up=1:2", "eye=1:2:3,from=1:0:0", "elevation=91", "azimuth=30,", "azimuth=nan",
        "eye=1:2:3,target=1:2:3", "up=0:1:0,eye=1:2:3,target=1:9:3", "from=1:1:0,up=-2:-2:0",
        "from=1e-200:0:0"})
    message_of<UsageError>([&] { parse_camera(text); });
  // The default target is the scene's centre.
  const CameraRequest centre = parse_camera("eye=0:0:0");
  message_of<UsageError>([&] { make_camera(centre, {-1, -1, -1}, {1, 1, 1}, 1); });
  // Seen from above, `up` is another axis.
  const Camera above = make_camera(parse_camera("from=0:0:1"), {-1, -1, -1}, {1, 1, 1}, 1);
  EXPECT_NEAR(above.back.z, 1, 1e-12);
}

TEST(CameraMoves, OrbitKeepsDistanceAndAxes) {
  Camera camera({0, -5, 1}, {0, 0, 0}, {0, 0, 1});
  const double away = camera.distance();
  for (int i = 0; i < 1000; ++i) camera.orbit(0.1, 0.07, {0, 0, 1});
  EXPECT_NEAR(camera.distance(), away, 1e-9);
  EXPECT_NEAR(dot(camera.up, camera.back), 0, 1e-12);
  EXPECT_NEAR(dot(camera.right, camera.right), 1, 1e-12);
  // The ray through a projected point meets the point.
  const Vec3d point{0.3, 0.2, -0.4}, seen = camera.project(point, 300, 200);
  const WorldRay ray = camera.ray(seen.x, seen.y, 300, 200);
  const Vec3d v = point - ray.origin;
  EXPECT_NEAR(dot(v, v) - dot(v, ray.direction) * dot(v, ray.direction), 0, 1e-9);
}

}  // namespace
}  // namespace isobrick
