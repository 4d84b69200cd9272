#include "filters/unweld_stage.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "filters/mesh_spool.h"

namespace isobrick::inline v0 {

UnweldStage::UnweldStage(MeshSink& next, std::stop_token cancel, const ScratchPlace& place,
                         std::uint64_t memory)
    : FilterStage(next, std::move(cancel)),
      positions_(place, (memory - std::min(memory, kFixedMemory)) / 2),
      normals_(place, positions_.memory()),
      table_(kTable) {
  local_positions_.reserve(3 * kRun);
  local_normals_.reserve(3 * kRun);
  local_triangles_.reserve(kRun);
}

void UnweldStage::begin(const MeshHeader& header) {
  has_normals_ = header.has_normals;
  next().begin(header);
}

std::uint32_t UnweldStage::local_of(std::uint32_t vertex) {
  constexpr int shift = 32 - std::countr_zero(kTable);
  std::size_t i = vertex * std::uint32_t{0x9e3779b9} >> shift;
  while (table_[i].chunk == chunk_ && table_[i].vertex != vertex) i = (i + 1) & (kTable - 1);
  if (table_[i].chunk != chunk_) {
    table_[i] = {vertex, static_cast<std::uint32_t>(local_positions_.size()), chunk_};
    local_positions_.push_back(positions_[vertex]);
    if (has_normals_) local_normals_.push_back(normals_[vertex]);
  }
  return table_[i].local;
}

void UnweldStage::write_run(std::span<const Triangle> triangles) {
  check_cancelled();
  ++chunk_;
  local_positions_.clear();
  local_normals_.clear();
  local_triangles_.clear();
  for (Triangle triangle : triangles) {
    for (std::uint32_t& vertex : triangle) vertex = local_of(vertex);
    local_triangles_.push_back(triangle);
  }
  next().write({vertices_, local_positions_, local_normals_, local_triangles_});
  vertices_ += local_positions_.size();
}

void UnweldStage::write(const MeshChunk& chunk) {
  check_vertex_count(positions_.size() + chunk.positions.size());
  positions_.append(chunk.positions);
  normals_.append(chunk.normals);
  for (std::size_t i = 0; i < chunk.triangles.size(); i += kRun)
    write_run(chunk.triangles.subspan(i, std::min(kRun, chunk.triangles.size() - i)));
}

void UnweldStage::finish() {
  positions_.release();
  normals_.release();
  table_ = {};
  next().finish();
}

}  // namespace isobrick
