#pragma once

#include <cstdint>
#include <vector>

#include "filters/filter_stage.h"
#include "filters/scratch_array.h"

namespace isobrick::inline v0 {

/// Passes a welded mesh on to a sink of chunks that each stand alone. The triangles keep their
/// order and their first corners.
class UnweldStage final : public FilterStage {
 public:
  UnweldStage(MeshSink& next, std::stop_token cancel, const ScratchPlace& place,
              std::uint64_t memory);

  void begin(const MeshHeader& header) override;
  void write(const MeshChunk& chunk) override;
  void finish() override;

 private:
  /// Triangles of a chunk.
  static constexpr std::size_t kRun = std::size_t{1} << 12;
  static constexpr std::size_t kTable = kRun * 8;  ///< a power of two, for 3 vertices a triangle

  struct Entry {
    std::uint32_t vertex = 0, local = 0;
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
  std::uint32_t local_of(std::uint32_t vertex);
  void write_run(std::span<const Triangle> triangles);

  bool has_normals_ = false;
  ScratchArray<Vec3f> positions_, normals_;
  std::vector<Entry> table_;
  std::uint32_t chunk_ = 0;
  std::uint64_t vertices_ = 0;  ///< of the chunks before
  std::vector<Vec3f> local_positions_, local_normals_;
  std::vector<Triangle> local_triangles_;
};

}  // namespace isobrick
