#include "io/meshes/mesh_parts.h"

#include <cstring>
#include <filesystem>
#include <functional>
#include <memory>
#include <numeric>
#include <random>

#include "io/meshes/glb_sink.h"
#include "io/meshes/obj_sink.h"
#include "io/meshes/ply_sink.h"
#include "io/meshes/vtp_sink.h"
#include "mesh_chunks.h"
#include "mesh_reader.h"

namespace isobrick::inline v0 {
namespace {

namespace fs = std::filesystem;

template <class T>
StoredMesh::ReadAt reader_of(const std::vector<T>& items) {
  return [&items](std::uint64_t offset, std::span<std::byte> bytes) {
    ASSERT_LE(offset + bytes.size(), items.size() * sizeof(T));
    std::memcpy(bytes.data(), reinterpret_cast<const std::byte*>(items.data()) + offset,
                bytes.size());
  };
}

std::vector<WideTriangle> widened(std::span<const Triangle> triangles, std::uint64_t by = 0) {
  std::vector<WideTriangle> wide;
  for (const Triangle& t : triangles) wide.push_back({t[0] + by, t[1] + by, t[2] + by});
  return wide;
}

/// What is known of parts without their vertices.
struct PartSizes {
  std::uint64_t run, number, triangles, own, borrowed;
  bool operator==(const PartSizes&) const = default;
};

/// Cuts a mesh, and checks that each vertex and triangle belongs to one part.
std::vector<PartSizes> cut(const StoredMesh& mesh, const std::vector<MeshRun>& runs, MeshSize size,
                           std::uint64_t run_triangles) {
  std::vector<PartSizes> parts;
  std::uint64_t vertex = 0, triangle = 0;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    std::uint32_t number = 0;
    for_each_part(mesh, i, runs[i], run_triangles, [&](const MeshPart& part) {
      EXPECT_EQ(part.run, i);
      EXPECT_EQ(part.number, number++);
      EXPECT_EQ(part.first_triangle, triangle);
      EXPECT_EQ(part.first_vertex, vertex);
      EXPECT_LE(part.triangles, run_triangles);
      vertex += part.own_vertices;
      triangle += part.triangles;
      EXPECT_TRUE(std::is_sorted(part.borrowed.begin(), part.borrowed.end()));
      for (const std::uint64_t v : part.borrowed) EXPECT_LT(v, part.first_vertex);
      parts.push_back(
          {part.run, part.number, part.triangles, part.own_vertices, part.borrowed.size()});
    });
    EXPECT_EQ(triangle, std::min(size.triangles, (i + 1) * run_triangles));
  }
  EXPECT_EQ(vertex, size.vertices);
  EXPECT_EQ(triangle, size.triangles);
  return parts;
}

TEST(MeshParts, EveryVertexIsOwnedOnce) {
  const TestMesh ball = make_ball({0, 0, 0}, 1, 20);
  const auto wide = widened(ball.triangles);
  const MeshSize size{ball.positions.size() + 5, ball.triangles.size()};
  RunFinder finder(333);
  finder.add(0, ball.triangles);
  const auto runs = finder.runs(size);
  const auto parts = cut({.triangles = reader_of(ball.triangles)}, runs, size, 333);
  EXPECT_EQ(parts.size(), (size.triangles + 332) / 333);
  EXPECT_EQ(cut({.triangles = reader_of(wide), .wide = true}, runs, size, 333), parts);
}

/// Triangles that name vertices at random borrow many.
TEST(MeshParts, ARunThatBorrowsMuchIsCut) {
  constexpr std::uint64_t run = 100'000;
  std::mt19937 random(5);
  TestMesh mesh;
  for (std::uint32_t i = 0; i < 150'000; ++i) {
    std::uniform_int_distribution<std::uint32_t> any(0, i);
    mesh.triangles.push_back({i, any(random), any(random)});
  }
  const MeshSize size{150'000, mesh.triangles.size()};
  RunFinder finder(run);
  finder.add(0, mesh.triangles);
  const auto parts = cut({.triangles = reader_of(mesh.triangles)}, finder.runs(size), size, run);
  EXPECT_GT(parts.size(), 2u);
  EXPECT_EQ(parts.back().run, 1u);
  for (const PartSizes& part : parts) EXPECT_LT(part.borrowed, run / 8 + 4 * 3 * (1 << 14));
}

/// As several processes find them, each in triangles of its own.
TEST(RunFinder, FindsTheSameInAnyOrder) {
  const TestMesh ball = make_ball({0, 0, 0}, 1, 30);
  const MeshSize size{ball.positions.size(), ball.triangles.size()};
  RunFinder expected(500);
  expected.add(0, ball.triangles);
  std::vector<std::size_t> begins;
  for (std::size_t i = 0; i < ball.triangles.size(); i += 177) begins.push_back(i);
  std::shuffle(begins.begin(), begins.end(), std::mt19937(3));
  RunFinder joined(500);
  for (const std::size_t begin : begins) {
    const auto all = std::span<const Triangle>(ball.triangles);
    RunFinder one(500);
    one.add(begin, all.subspan(begin, std::min<std::size_t>(177, all.size() - begin)));
    joined.add(one.ends());
  }
  const auto runs = joined.runs(size), wanted = expected.runs(size);
  ASSERT_EQ(runs.size(), wanted.size());
  for (std::size_t i = 0; i < runs.size(); ++i) {
    EXPECT_EQ(runs[i].first_triangle, wanted[i].first_triangle);
    EXPECT_EQ(runs[i].triangles, wanted[i].triangles);
    EXPECT_EQ(runs[i].first_vertex, wanted[i].first_vertex);
    EXPECT_EQ(runs[i].end_vertex, wanted[i].end_vertex);
  }
}

/// Vertices behind 2³² get the numbers that they would have at the beginning.
TEST(MeshParts, NumbersOf64BitsAreCutAlike) {
  constexpr std::uint64_t far = std::uint64_t{3} << 32;
  const TestMesh ball = make_ball({0, 0, 0}, 1, 20);
  const auto wide = widened(ball.triangles, far);
  const auto numbers_of = [](const StoredMesh& mesh, std::vector<MeshRun> runs,
                             std::uint64_t shift) {
    for (MeshRun& run : runs) {
      run.first_vertex += shift;
      run.end_vertex += shift;
    }
    std::vector<Triangle> numbers;
    for (std::size_t i = 0; i < runs.size(); ++i)
      for_each_part(mesh, i, runs[i], 333, [&](const MeshPart& part) {
        for_each_triangle_batch(mesh, part, [&](std::span<const Triangle> batch) {
          numbers.insert(numbers.end(), batch.begin(), batch.end());
        });
      });
    return numbers;
  };
  RunFinder finder(333);
  finder.add(0, ball.triangles);
  const auto runs = finder.runs({ball.positions.size(), ball.triangles.size()});
  EXPECT_EQ(numbers_of({.triangles = reader_of(wide), .wide = true}, runs, far),
            numbers_of({.triangles = reader_of(ball.triangles)}, runs, 0));
}

/// A mesh with numbers of 64 bits is the file of one with 32.
TEST(WideMeshes, AreTheSameFiles) {
  const TempDir dir;
  const Chunks chunks = make_chunks(500);
  const std::pair<std::string, std::function<std::unique_ptr<MeshSink>(std::string)>> sinks[] = {
      {"a.obj", [](auto path) { return std::make_unique<ObjSink>(path, false); }},
      {"a.pvtp", [](auto path) { return std::make_unique<PvtpSink>(path, false, 1000); }},
      {"a.glb", [](auto path) {
         return std::make_unique<GlbSink>(path, false,
                                          GlbOptions{.file_bytes = 0, .part_triangles = 1000});
       }}};
  for (const auto& [name, open] : sinks) {
    std::vector<std::pair<std::string, std::string>> files[2];
    for (const bool wide : {false, true}) {
      const std::string folder = std::to_string(wide) + name;
      fs::create_directory(dir / folder);
      const auto sink = open(dir / (folder + "/" + name));
      EXPECT_TRUE(sink->takes_wide());
      write(*sink, chunks, true, "", wide);
      for (const auto& entry : fs::recursive_directory_iterator(dir / folder))
        if (entry.is_regular_file())
          files[wide].emplace_back(entry.path().filename(), read_bytes(entry.path()));
      std::sort(files[wide].begin(), files[wide].end());
    }
    EXPECT_EQ(files[0].size(), name == "a.obj" ? 1u : 8u) << name;
    EXPECT_TRUE(files[0] == files[1]) << name;
  }
}

TEST(WideMeshes, OfVtpHaveInt64) {
  const TempDir dir;
  const Chunks chunks = make_chunks(500);
  VtpSink narrow(dir / "n.vtp", false), wide(dir / "w.vtp", false);
  write(narrow, chunks, true);
  write(wide, chunks, true, "", true);
  const std::string bytes = dir.read("w.vtp");
  EXPECT_TRUE(contains(bytes, "type=\"Int64\" Name=\"connectivity\""));
  const TestMesh mesh = read_vtp(bytes), expected = read_vtp(dir.read("n.vtp"));
  EXPECT_EQ(mesh.triangles, expected.triangles);
  EXPECT_EQ(mesh.positions, expected.positions);
  EXPECT_EQ(mesh.normals, expected.normals);
}

TEST(WideMeshes, AreRefusedByOtherFormats) {
  const TempDir dir;
  EXPECT_FALSE(PlySink(dir / "a.ply", false).takes_wide());
}

/// A run that borrows much is cut in the file as well, and such files can be replaced.
TEST(Pvtp, ARunMayBeSeveralFiles) {
  const TempDir dir;
  std::mt19937 random(5);
  Chunks chunks;
  for (std::uint32_t i = 0; i < 150'000; ++i) {
    std::uniform_int_distribution<std::uint32_t> any(0, i);
    chunks.mesh.positions.push_back({static_cast<float>(i), 0, 0});
    chunks.mesh.triangles.push_back({i, any(random), any(random)});
  }
  chunks.ends = {{chunks.mesh.positions.size(), chunks.mesh.triangles.size()}};
  for (const int threads : {1, 2}) {
    PvtpSink sink(dir / "a.pvtp", true, 100'000, threads);
    write(sink, chunks, false);
    const PvtpFile file = read_pvtp(dir.read("a.pvtp"), dir / ".");
    EXPECT_GT(file.parts, 2u);
    EXPECT_TRUE(contains(dir.read("a.pvtp"), "/part_1_1.vtp"));
    ASSERT_EQ(file.mesh.triangles.size(), chunks.mesh.triangles.size());
    for (std::size_t i = 0; i < file.mesh.triangles.size(); ++i)
      for (std::size_t corner = 0; corner < 3; ++corner)
        ASSERT_EQ(file.ids[file.mesh.triangles[i][corner]], chunks.mesh.triangles[i][corner]) << i;
  }
  EXPECT_EQ(dir.list(), (std::vector<std::string>{"a.pvtp", "a.pvtp.parts-2"}));
}

TEST(Pvtp, GlobalIdsAreNumbersInTheWholeMesh) {
  const TempDir dir;
  const Chunks chunks = make_chunks(500);
  PvtpSink sink(dir / "a.pvtp", false, 1000);
  write(sink, chunks, true);
  const PvtpFile file = read_pvtp(dir.read("a.pvtp"), dir / ".");
  ASSERT_EQ(file.ids.size(), file.mesh.positions.size());
  ASSERT_GT(file.ids.size(), chunks.mesh.positions.size());
  for (std::size_t i = 0; i < file.ids.size(); ++i) {
    ASSERT_LT(file.ids[i], chunks.mesh.positions.size());
    EXPECT_EQ(file.mesh.positions[i], chunks.mesh.positions[file.ids[i]]);
  }
  EXPECT_TRUE(contains(dir.read("a.pvtp"), "GlobalIds=\"GlobalPointIds\""));
}

}  // namespace
}  // namespace isobrick
