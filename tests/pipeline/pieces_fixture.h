#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include <isobrick/convert.h>
#include <isobrick/pieces.h>
#include "tests/pipeline/convert_doubles.h"
#include "tests/surface/field.h"
#include "tests/temporary_folder.h"

namespace isobrick::test {

/// Keeps the mesh and what is known before it; may fail.
class PieceSink final : public MeshSink {
 public:
  Indexing indexing() const override { return Indexing::welded; }
  void begin(const MeshHeader& known) override { header = known; }
  void write(const MeshChunk& chunk) override {
    EXPECT_EQ(chunk.first_vertex, positions.size());
    largest_chunk = std::max<std::size_t>(
        largest_chunk,
        chunk.positions.size_bytes() + chunk.normals.size_bytes() + chunk.triangles.size_bytes());
    positions.insert(positions.end(), chunk.positions.begin(), chunk.positions.end());
    normals.insert(normals.end(), chunk.normals.begin(), chunk.normals.end());
    triangles.insert(triangles.end(), chunk.triangles.begin(), chunk.triangles.end());
  }
  void finish() override { finished = true; }
  std::uint64_t bytes() const override { return 0; }

  MeshHeader header;
  std::vector<Vec3f> positions, normals;
  std::vector<Triangle> triangles;
  std::size_t largest_chunk = 0;
  bool finished = false;
};

inline std::string content_of_piece(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

inline void write_bytes(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

inline void expect_same(const PieceSink& a, const PieceSink& b) {
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.normals, b.normals);
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_EQ(a.header.has_normals, b.header.has_normals);
  EXPECT_EQ(a.header.world_lo, b.header.world_lo);
  EXPECT_EQ(a.header.world_hi, b.header.world_hi);
  EXPECT_EQ(a.header.unit, b.header.unit);
  ASSERT_EQ(a.header.surface.has_value(), b.header.surface.has_value());
  if (!a.header.surface) return;
  EXPECT_EQ(a.header.surface->lo, b.header.surface->lo);
  EXPECT_EQ(a.header.surface->hi, b.header.surface->hi);
}

/// Noise in one half and smooth waves in the other, with calm regions; many samples equal 50.
template <class T>
isobrick::testing::Field<T> busy_field(Int3 extent) {
  std::mt19937 random(5);
  return isobrick::testing::Field<T>(extent, [&](Int3 p) -> double {
    const auto noise = static_cast<double>(random() % 100);
    if (p.z > 70 && p.y < 40) return 0;
    if (p.x < 45) return std::floor(noise);
    return std::floor(50 + 45 * std::sin(static_cast<double>(p.x + 2 * p.y - p.z) / 11));
  });
}

class Pieces : public ::testing::Test {
 protected:
  template <class T>
  StoreReader store(const isobrick::testing::Field<T>& field, ConvertOptions options = {}) {
    MemorySource source(field.extent, scalar_type_of<T>, as_bytes(field.samples));
    source.mutable_info().transform.spacing = {0.5, 1, 2};
    source.mutable_info().transform.unit = "millimeter";
    const std::filesystem::path path = folder_ / ("s" + std::to_string(next_++) + ".zarr");
    convert(source, path, options);
    return StoreReader(path);
  }

  static PieceSink whole(const StoreReader& store, const ExtractOptions& options) {
    PieceSink sink;
    extract(store, options, sink);
    return sink;
  }

  /// The pieces of so many parts, in the order of their numbers.
  std::vector<std::filesystem::path> pieces(const StoreReader& store, const ExtractOptions& options,
                                            std::uint32_t count, const std::string& name = "p") {
    std::vector<std::filesystem::path> paths;
    for (std::uint32_t i = 1; i <= count; ++i) {
      paths.push_back(folder_ / (name + std::to_string(i) + ".piece"));
      std::filesystem::remove(paths.back());
      EXPECT_FALSE(extract_piece(store, options, {i, count}, paths.back()).is_kept);
    }
    return paths;
  }

  static PieceSink merged(const std::vector<std::filesystem::path>& paths,
                          const MergeOptions& options = {}) {
    PieceSink sink;
    merge_pieces(paths, sink, options);
    EXPECT_TRUE(sink.finished);
    return sink;
  }

  /// What refuses the pieces.
  template <class Failure>
  static std::string refusal(const std::vector<std::filesystem::path>& paths) {
    PieceSink sink;
    try {
      merge_pieces(paths, sink);
    } catch (const Failure& failure) {
      EXPECT_FALSE(sink.finished);
      EXPECT_EQ(std::string(failure.what()).find('\n'), std::string::npos);
      return failure.what();
    }
    ADD_FAILURE() << "merged";
    return {};
  }

  TemporaryFolder folder_;
  int next_ = 0;
};

}  // namespace isobrick::test
