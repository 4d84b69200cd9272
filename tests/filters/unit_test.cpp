#include <isobrick/mesh_filters.h>

#include <gtest/gtest.h>

#include <isobrick/error.h>
#include "tests/filters/filter_fixture.h"

namespace isobrick::test {
namespace {

class HeaderSink final : public MeshSink {
 public:
  explicit HeaderSink(Indexing indexing) : indexing_(indexing) {}
  Indexing indexing() const override { return indexing_; }
  void begin(const MeshHeader& given) override { header = given; }
  void write(const MeshChunk& chunk) override {
    positions.insert(positions.end(), chunk.positions.begin(), chunk.positions.end());
  }
  void finish() override {}
  std::uint64_t bytes() const override { return 0; }

  MeshHeader header;
  std::vector<Vec3f> positions;

 private:
  Indexing indexing_;
};

TEST(MeshUnit, ScalesPositionsAndBounds) {
  for (const Indexing indexing : {Indexing::welded, Indexing::chunk_local}) {
    HeaderSink sink(indexing);
    MeshFilter filter(sink, {.unit = "millimeter"});
    EXPECT_EQ(filter.indexing(), indexing);
    filter.begin({.world_lo = {-1, 0, 2},
                  .world_hi = {1, 2, 3},
                  .surface = MeshBounds{{0, 0, 2}, {1, 1, 3}},
                  .unit = "micrometer"});
    const std::vector<Vec3f> positions{{1, 2, 3}, {4000, 5, -6}};
    filter.write({.positions = positions});
    filter.finish();
    EXPECT_EQ(sink.header.unit, "millimeter");
    EXPECT_DOUBLE_EQ(sink.header.world_lo.x, -0.001);
    EXPECT_DOUBLE_EQ(sink.header.world_hi.y, 0.002);
    EXPECT_DOUBLE_EQ(sink.header.surface->hi.z, 0.003);
    ASSERT_EQ(sink.positions.size(), 2U);
    EXPECT_EQ(sink.positions[1], (Vec3f{4.0f, 0.005f, -0.006f}));
  }
}

TEST(MeshUnit, MeasuresAreInTheNewUnit) {
  Mesh mesh = sphere(30);
  mesh.unit = "meter";
  Mesh result;
  MemorySink sink(result);
  MeshFilter filter(sink, {.unit = "millimeter", .measure = true});
  filter.begin({.unit = "meter"});
  filter.write(mesh.chunk());
  filter.finish();
  EXPECT_EQ(filter.measure()->unit, "millimeter");
  EXPECT_NEAR(filter.measure()->area, 1e6 * measure(mesh).area, 1);
}

TEST(MeshUnit, RefusesWhatIsNotKnown) {
  Mesh mesh;
  MemorySink sink(mesh);
  EXPECT_THROW(MeshFilter(sink, {.unit = "mm"}), UsageError);  // its name is millimeter
  MeshFilter filter(sink, {.unit = "millimeter"});
  EXPECT_THROW(filter.begin({}), UsageError);
}

}  // namespace
}  // namespace isobrick::test
