#pragma once

#include <cstddef>
#include <utility>

#include <isobrick/mesh.h>
#include "core/box_union.h"

namespace isobrick::python {

/// Finds the bounds of a surface. A large one is not extracted to its end: those of its active
/// blocks, which are a little larger, are enough.
class BoundsSink final : public MeshSink {
 public:
  /// Thrown by write() once there are too many triangles.
  struct Enough {};

  Indexing indexing() const override { return Indexing::chunk_local; }
  void begin(const MeshHeader& header) override {
    max_bounds_ = header.surface.value_or(MeshBounds{header.world_lo, header.world_hi});
  }
  void write(const MeshChunk& chunk) override {
    constexpr std::size_t limit = std::size_t{1} << 20;
    triangles_ += chunk.triangles.size();
    if (triangles_ > limit) throw Enough();
    for (const Vec3f& p : chunk.positions) exact_.include({{p.x, p.y, p.z}, {p.x, p.y, p.z}});
  }
  void finish() override {
    if (exact_.box()) max_bounds_ = *exact_.box();
  }
  std::uint64_t bytes() const override { return 0; }

  /// Without triangles those of the volume.
  MeshBounds bounds() const { return max_bounds_; }

 private:
  MeshBounds max_bounds_;
  BoxUnion<MeshBounds> exact_;
  std::size_t triangles_ = 0;
};

/// The bounds of the surface that `extract(sink)` writes.
template <class F>
std::pair<Vec3d, Vec3d> surface_bounds(F&& extract) {
  BoundsSink sink;
  try {
    extract(sink);
  } catch (const BoundsSink::Enough&) {
    // The blocks' bounds stay.
  }
  return {sink.bounds().lo, sink.bounds().hi};
}

}  // namespace isobrick::python
