#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "io/meshes/glb_sink.h"
#include "io/meshes/obj_sink.h"
#include "io/meshes/ply_sink.h"
#include "io/meshes/stl_sink.h"
#include "io/meshes/vtp_sink.h"
#include "tests/io/bytes/temp_dir.h"
#include "tests/io/meshes/mesh_files.h"

// Vertex attributes in files, which our readers pass over.
namespace isobrick::inline v0 {
namespace {

/// Adds two attributes: x, and one that is not finite.
class AddAttributes final : public MeshSink {
 public:
  explicit AddAttributes(MeshSink& sink) : sink_(sink) {}

  Indexing indexing() const override { return sink_.indexing(); }
  void begin(const MeshHeader& header) override {
    MeshHeader named = header;
    named.attributes = {"first", "Odd_2"};
    sink_.begin(named);
  }
  void write(const MeshChunk& chunk) override {
    std::vector<float> first, odd;
    for (const Vec3f& p : chunk.positions) {
      first.push_back(p.x);
      odd.push_back(p.y > 2 ? std::numeric_limits<float>::quiet_NaN()
                            : std::numeric_limits<float>::infinity());
    }
    const VertexAttribute views[] = {{"first", first}, {"Odd_2", odd}};
    MeshChunk with = chunk;
    with.attributes = views;
    sink_.write(with);
  }
  void finish() override { sink_.finish(); }
  std::uint64_t bytes() const override { return sink_.bytes(); }

 private:
  MeshSink& sink_;
};

template <class Sink>
void write_attributed(Sink&& sink, bool normals = true) {
  AddAttributes add(sink);
  write_ball(add, normals);
}

TEST(AttributeFormats, ReadersPassOverThem) {
  const TempDir dir;
  write_attributed(PlySink(dir / "a.ply", false));
  write_attributed(PlySink(dir / "plain.ply", false), false);
  write_attributed(GlbSink(dir / "a.glb", false));
  write_attributed(GlbSink(dir / "q.glb", false, {.quantize = true}));
  write_attributed(GlbSink(dir / "parts.glb", false, {.file_bytes = 100, .part_triangles = 50}));
  write_attributed(ObjSink(dir / "a.obj", false, 1));
  expect_ball(dir / "a.ply", true, 1e-6);
  expect_ball(dir / "plain.ply", false, 1e-6);
  expect_ball(dir / "a.glb", true, 1e-6);
  expect_ball(dir / "q.glb", true, 2.1 / 65535);
  EXPECT_EQ(corners_of(dir / "parts.glb"), corners_of(dir / "a.glb"));
  expect_ball(dir / "a.obj", true, 1e-6);
}

#ifdef ISOBRICK_WITH_EXPAT
TEST(AttributeFormats, ReadersOfVtkPassOverThem) {
  const TempDir dir;
  write_attributed(VtpSink(dir / "a.vtp", false));
  write_attributed(VtpSink(dir / "plain.vtp", false), false);
  write_attributed(PvtpSink(dir / "a.pvtp", false, 50));
  expect_ball(dir / "a.vtp", true, 1e-6);
  expect_ball(dir / "plain.vtp", false, 1e-6);
  EXPECT_EQ(corners_of(dir / "a.pvtp"), corners_of(dir / "a.vtp"));
}
#endif

/// The vertex rows of a GLB of one buffer, which begin it.
TEST(AttributeFormats, GltfHasFiniteNumbersOnly) {
  const TempDir dir;
  write_attributed(GlbSink(dir / "a.glb", false));
  const std::string glb = dir.read("a.glb");
  EXPECT_NE(glb.find("\"_FIRST\":2,\"_ODD_2\":3"), glb.npos);
  std::uint32_t json = 0;
  std::memcpy(&json, glb.data() + 12, 4);
  const std::size_t vertices = make_ball({1, 2, 3}, 1, kRings).positions.size();
  const char* row = glb.data() + 20 + json + 8;
  for (std::size_t i = 0; i < vertices; ++i, row += 32) {
    float values[8];
    std::memcpy(values, row, sizeof(values));
    ASSERT_EQ(values[6], values[0]);
    constexpr float most = std::numeric_limits<float>::max();
    ASSERT_EQ(values[7], values[1] > 2 ? -most : most);
  }
}

}  // namespace
}  // namespace isobrick
