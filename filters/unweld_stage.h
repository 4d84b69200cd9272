#pragma once

#include <cstdint>
#include <vector>

#include "filters/filter_stage.h"
#include "filters/scratch_array.h"
#include "filters/vertex_numbers.h"

namespace isobrick::inline v0 {

/// Passes a welded mesh on to a sink of chunks that each stand alone. The triangles keep their
/// order and their first corners.
template <class Number>
class UnweldStage final : public FilterStage {
 public:
  UnweldStage(MeshSink& next, std::stop_token cancel, const ScratchPlace& place,
              std::uint64_t memory);

  bool takes_wide() const override { return true; }
  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;

 private:
  /// Triangles of a chunk.
  static constexpr std::size_t kRun = std::size_t{1} << 12;
  static constexpr std::size_t kTable = kRun * 8;  ///< a power of two, for 3 vertices a triangle

  struct Entry {
    Number vertex = 0;
    std::uint32_t local = 0;
    std::uint32_t chunk = 0;  ///< whose entry it is; free in all others
  };
  /// Of the table and of a chunk.
  static constexpr std::uint64_t kFixedMemory =
      kTable * sizeof(Entry) + 3 * kRun * 2 * sizeof(Vec3f) + kRun * sizeof(Triangle);

  std::uint64_t own_bytes() const override {
    return positions_.file_bytes() + normals_.file_bytes();
  }
  std::uint64_t own_memory() const override {
    return positions_.memory() + normals_.memory() + kFixedMemory;
  }
  std::uint32_t local_of(Number vertex);
  void write_run(std::span<const TriangleOf<Number>> triangles);

  bool has_normals_ = false;
  ScratchArray<Vec3f> positions_, normals_;
  std::vector<Entry> table_;
  std::uint32_t chunk_ = 0;
  std::uint64_t vertices_ = 0;  ///< of the chunks before
  std::vector<Vec3f> local_positions_, local_normals_;
  std::vector<Triangle> local_triangles_;
  std::vector<TriangleOf<Number>> converted_;  ///< of a chunk
};

}  // namespace isobrick
