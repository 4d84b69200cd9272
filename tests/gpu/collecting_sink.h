#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <span>

#include <isobrick/error.h>
#include <isobrick/surface_options.h>

namespace isobrick::testing {

/// Appends chunks to a mesh whose vertices are numbered from its first.
class CollectingSink : public MeshSink {
 public:
  explicit CollectingSink(Indexing indexing = Indexing::welded) : indexing_(indexing) {}

  Indexing indexing() const override { return indexing_; }
  void begin(const MeshHeader&) override {}
  void write(const MeshChunk& chunk) override {
    EXPECT_EQ(chunk.first_vertex, mesh.positions.size());
    max_chunk = std::max(max_chunk, chunk.positions.size_bytes() + chunk.normals.size_bytes() +
                                        chunk.triangles.size_bytes());
    append(mesh.positions, chunk.positions);
    append(mesh.normals, chunk.normals);
    const std::size_t before = mesh.triangles.size();
    append(mesh.triangles, chunk.triangles);
    if (indexing_ == Indexing::welded) return;
    for (std::size_t i = before; i < mesh.triangles.size(); ++i)
      for (std::uint32_t& v : mesh.triangles[i]) {
        EXPECT_LT(v, chunk.positions.size());
        v += static_cast<std::uint32_t>(chunk.first_vertex);
      }
  }
  void finish() override {}
  std::uint64_t bytes() const override { return 0; }

  isobrick::Mesh mesh;
  std::size_t max_chunk = 0;  ///< bytes

 private:
  template <class V>
  static void append(PodBuffer<V>& to, std::span<const V> values) {
    const std::size_t before = to.size();
    to.resize(before + values.size());
    std::copy(values.begin(), values.end(), to.begin() + before);
  }

  Indexing indexing_;
};

/// Fails at one of its chunks, the first is 1.
class FailingSink final : public CollectingSink {
 public:
  explicit FailingSink(int at) : at_(at) {}
  void write(const MeshChunk&) override {
    if (++taken == at_) throw Error("the sink broke");
  }
  int taken = 0;

 private:
  int at_;
};

}  // namespace isobrick::testing
