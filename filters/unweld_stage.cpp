#include "filters/unweld_stage.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <utility>

namespace isobrick::inline v0 {

template <class Number>
UnweldStage<Number>::UnweldStage(MeshSink& next, std::stop_token cancel, const ScratchPlace& place,
                                 std::uint64_t memory)
    : FilterStage(next, std::move(cancel)),
      positions_(place, (memory - std::min(memory, kFixedMemory)) / 2),
      normals_(place, positions_.memory()),
      table_(kTable) {
  local_positions_.reserve(3 * kRun);
  local_normals_.reserve(3 * kRun);
  local_triangles_.reserve(kRun);
}

template <class Number>
void UnweldStage<Number>::begin(const MeshHeader& header) {
  has_normals_ = header.has_normals;
  MeshHeader local = header;
  local.wide = false;
  next().begin(local);
}

template <class Number>
std::uint32_t UnweldStage<Number>::local_of(Number vertex) {
  constexpr int shift = std::numeric_limits<Number>::digits - std::countr_zero(kTable);
  constexpr auto factor = static_cast<Number>(kIsWide<Number> ? 0x9e3779b97f4a7c15u : 0x9e3779b9u);
  auto i = static_cast<std::size_t>(static_cast<Number>(vertex * factor) >> shift);
  while (table_[i].chunk == chunk_ && table_[i].vertex != vertex) i = (i + 1) & (kTable - 1);
  if (table_[i].chunk != chunk_) {
    table_[i] = {vertex, static_cast<std::uint32_t>(local_positions_.size()), chunk_};
    local_positions_.push_back(positions_[vertex]);
    if (has_normals_) local_normals_.push_back(normals_[vertex]);
  }
  return table_[i].local;
}

template <class Number>
void UnweldStage<Number>::write_run(std::span<const TriangleOf<Number>> triangles) {
  check_cancelled();
  ++chunk_;
  local_positions_.clear();
  local_normals_.clear();
  local_triangles_.clear();
  for (const auto& t : triangles) {
    // In this order: a vertex has the number of its first corner.
    const std::uint32_t a = local_of(t[0]), b = local_of(t[1]), c = local_of(t[2]);
    local_triangles_.push_back({a, b, c});
  }
  next().write({vertices_, local_positions_, local_normals_, local_triangles_});
  vertices_ += local_positions_.size();
}

template <class Number>
void UnweldStage<Number>::write(const MeshChunk& chunk) {
  check_vertex_count<Number>(positions_.size() + chunk.positions.size());
  positions_.append(chunk.positions);
  normals_.append(chunk.normals);
  const auto triangles = triangles_of<Number>(chunk, converted_);
  for (std::size_t i = 0; i < triangles.size(); i += kRun)
    write_run(triangles.subspan(i, std::min(kRun, triangles.size() - i)));
}

template <class Number>
void UnweldStage<Number>::finish() {
  positions_.release();
  normals_.release();
  table_ = {};
  next().finish();
}

template class UnweldStage<std::uint32_t>;
template class UnweldStage<std::uint64_t>;

}  // namespace isobrick
