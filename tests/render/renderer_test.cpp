#include "isobrick/render/renderer.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/meshes/test_meshes.h"
#include "tests/render/pictures.h"

namespace isobrick {
namespace {

Camera front_camera(double aspect) {
  Camera camera({0, -1, 0}, {0, 0, 0}, {0, 0, 1});
  camera.fit({-1, -1, -1}, {1, 1, 1}, aspect);
  return camera;
}

TEST_F(RenderTest, ABallIsADiscOfTheRightSize) {
  MeshPool pool;
  const TestMesh ball = make_ball({0, 0, 0}, 1, 100);
  const PooledMesh mesh = pool.add(ball.chunk());
  const Camera camera = front_camera(1.25);
  renderer().begin(camera, 200, 160, {});
  renderer().draw(mesh, {});
  renderer().end();
  const Pixels pixels(renderer());
  // Rays that touch the ball leave the eye at asin(1 / distance).
  const double angle = std::asin(1 / camera.distance());
  const double radius = std::tan(angle) / (camera.extent_at(1) / 160);
  EXPECT_NEAR(pixels.count_surface(), 3.14159265 * radius * radius, 0.02 * 3.14 * radius * radius);
  EXPECT_TRUE(pixels.surface(100, 80));
  EXPECT_FALSE(pixels.surface(3, 3));
}

TEST_F(RenderTest, PickingTellsPlaceAndMesh) {
  const TestMesh ball = make_ball({0, 0, 0}, 1, 200);
  renderer().begin(front_camera(1.25), 200, 160, {.picking = true});
  renderer().draw(ball.chunk(), {.id = 7});
  renderer().end();
  const std::optional<Picked> picked = renderer().pick(110, 60);
  ASSERT_TRUE(picked);
  EXPECT_EQ(picked->id, 7u);
  const Vec3d p = picked->position;
  EXPECT_NEAR(std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z), 1, 1e-3);
  EXPECT_GT(p.x, 0);
  EXPECT_GT(p.z, 0);
  EXPECT_FALSE(renderer().pick(3, 3));
  EXPECT_FALSE(renderer().pick(-1, 80));
}

}  // namespace
}  // namespace isobrick
