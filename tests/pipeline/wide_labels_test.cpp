#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <string>

#include <isobrick/error.h>
#include <isobrick/label_pieces.h>
#include "pipeline/labels/label_meshes.h"
#include "pipeline/labels/label_piece_file.h"
#include "tests/pipeline/labels_fixture.h"

// A label with more vertices than 32 bits number: with a limit that small meshes exceed.

namespace isobrick::test {
namespace {

/// Takes a mesh with numbers of either kind.
class EitherSink final : public MeshSink {
 public:
  EitherSink(Indexing indexing, bool wide) : indexing_(indexing), takes_wide_(wide) {}

  Indexing indexing() const override { return indexing_; }
  bool takes_wide() const override { return takes_wide_; }
  void begin(const MeshHeader& header) override { is_wide = header.wide; }
  void write(const MeshChunk& chunk) override {
    const std::uint64_t first = mesh.positions.size();
    EXPECT_EQ(is_wide ? chunk.triangles.size() : chunk.wide_triangles.size(), 0u);
    mesh.positions.insert(mesh.positions.end(), chunk.positions.begin(), chunk.positions.end());
    const std::uint64_t shift = indexing_ == Indexing::chunk_local ? first : 0;
    const auto add = [&](const auto& t) {
      mesh.triangles.push_back({static_cast<std::uint32_t>(t[0] + shift),
                                static_cast<std::uint32_t>(t[1] + shift),
                                static_cast<std::uint32_t>(t[2] + shift)});
    };
    for (const Triangle& t : chunk.triangles) add(t);
    for (const WideTriangle& t : chunk.wide_triangles) add(t);
  }
  void finish() override {}
  std::uint64_t bytes() const override { return 0; }

  isobrick::testing::Mesh mesh;
  bool is_wide = false;

 private:
  Indexing indexing_;
  bool takes_wide_;
};

class WideLabels : public Labels {
 protected:
  /// Passes the meshes of a piece on, with a limit.
  template <class Visit>
  static void visit_labels(const std::filesystem::path& piece, std::uint64_t limit, Visit&& visit) {
    LabelPieceReader reader(piece);
    const LabelImage image = reader.description().image();
    LabelMeshes meshes(image, {.scratch_beside = "-",
                               .label_bytes = std::uint64_t{1} << 24,
                               .max_narrow_vertices = limit});
    for (auto record = reader.next(); !record.empty(); record = reader.next())
      meshes.append(record);
    Workers workers(1);
    meshes.finish(workers, visit, no_progress());
  }
};

TEST_F(WideLabels, HaveTheSameMeshes) {
  const StoreReader reader = store(cells<std::uint8_t>({100, 70, 66}, 5, 3));
  const auto path = folder_ / "p.piece";
  extract_label_piece(reader, {}, {1, 1}, path);
  for (const Indexing indexing : {Indexing::welded, Indexing::chunk_local}) {
    Meshes expected;
    visit_labels(path, kMaxNarrowVertices, [&](const LabelMesh& label) {
      EitherSink sink(indexing, true);
      label.write(sink);
      EXPECT_FALSE(sink.is_wide);
      expected[label.label()] = sink.mesh;
    });
    ASSERT_GE(expected.size(), 3u);
    std::uint64_t limit = 0;
    for (const auto& [label, mesh] : expected)
      limit = std::max<std::uint64_t>(limit, mesh.positions.size());
    int wide = 0;
    visit_labels(path, limit - 1, [&](const LabelMesh& label) {
      EitherSink sink(indexing, true);
      label.write(sink);
      EXPECT_EQ(sink.is_wide, indexing == Indexing::welded && label.size().vertices == limit);
      wide += sink.is_wide;
      EXPECT_EQ(sink.mesh, expected.at(label.label()));
    });
    EXPECT_EQ(wide, indexing == Indexing::welded ? 1 : 0);
  }
}

TEST_F(WideLabels, AreRefusedByASinkThatDoesNotTakeThem) {
  const StoreReader reader = store(cells<std::uint8_t>({40, 40, 40}, 5, 3));
  const auto path = folder_ / "p.piece";
  extract_label_piece(reader, {.labels = {{2, 2}}}, {1, 1}, path);
  const auto write_to = [&](Indexing indexing) {
    visit_labels(path, 10, [&](const LabelMesh& label) {
      EitherSink sink(indexing, false);
      label.write(sink);
    });
  };
  try {
    write_to(Indexing::welded);
    ADD_FAILURE() << "a sink took too many vertices";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("label 2 has"), std::string::npos) << error.what();
  }
  EXPECT_NO_THROW(write_to(Indexing::chunk_local)) << "numbers of chunks are small";
}

}  // namespace
}  // namespace isobrick::test
