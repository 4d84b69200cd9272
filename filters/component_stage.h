#pragma once

#include <cstdint>
#include <vector>

#include "filters/filter_stage.h"
#include "filters/mesh_spool.h"
#include "filters/vertex_sets.h"

namespace isobrick::inline v0 {

/// Which components stay.
struct ComponentChoice {
  std::uint64_t min_triangles = 0;
  std::uint64_t largest = 0;  ///< so many with most triangles; 0: all
};

/// Passes on the chosen components of a mesh, their vertices and triangles in the order that they
/// had. Vertices that no triangle names are dropped.
template <class Number>
class ComponentStage final : public FilterStage {
 public:
  ComponentStage(MeshSink& next, std::stop_token cancel, const ScratchPlace& place,
                 std::uint64_t memory, const ComponentChoice& choice,
                 std::uint64_t max_narrow_vertices = kMaxNarrowVertices);

  /// What stays may be small enough for any sink.
  bool takes_wide() const override { return true; }
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;

 private:
  /// Of the components as large as the smallest one kept, the first `equal` are kept.
  struct Threshold {
    std::uint64_t triangles = 0, equal = 0;
  };

  std::uint64_t own_bytes() const override { return spool_.bytes(); }
  std::uint64_t own_memory() const override {
    return spool_.memory() + sets_.memory() + sizes_.memory() + numbers_.memory();
  }
  void count_triangles();
  /// Calls f(size) for each component, by first vertex. Its size may be set to 0: it goes then.
  template <class F>
  void for_each_component(F&& f);
  Threshold find_threshold();
  void choose();
  void number_vertices();
  void begin_next();
  void write_vertices();
  void write_triangles();

  ComponentChoice choice_;
  std::uint64_t max_narrow_vertices_;
  MeshHeader header_;  ///< of the mesh that leaves
  MeshSpool<Number> spool_;
  VertexSets<Number> sets_;
  ScratchArray<std::uint64_t> sizes_;  ///< triangles of a component, at its first vertex
  ScratchArray<Number> numbers_;       ///< 1 more than the new one of a vertex, or 0: it goes
  std::uint64_t kept_vertices_ = 0;
  std::vector<TriangleOf<Number>> converted_;  ///< of a chunk
};

}  // namespace isobrick
