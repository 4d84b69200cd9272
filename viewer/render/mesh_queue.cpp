#include "viewer/render/mesh_queue.h"

#include <algorithm>
#include <utility>

namespace isobrick::inline v0 {

void MeshQueue::add(const PooledMesh& mesh, const MeshStyle& style) {
  draws_.push_back({&mesh, style, 0, mesh.place().triangle_count});
  remaining_ += mesh.place().triangle_count;
}

std::span<const MeshDraw> MeshQueue::take(std::uint64_t max_triangles) {
  if (!sorted_)
    std::stable_sort(draws_.begin(), draws_.end(), [](const MeshDraw& a, const MeshDraw& b) {
      return std::pair(may_be_clipped(a.style), a.block()) <
             std::pair(may_be_clipped(b.style), b.block());
    });
  sorted_ = true;
  batch_.clear();
  max_triangles = std::max<std::uint64_t>(max_triangles, 1);
  while (max_triangles > 0 && next_ < draws_.size()) {
    MeshDraw& rest = draws_[next_];
    MeshDraw& taken = batch_.emplace_back(rest);
    taken.triangles =
        static_cast<std::uint32_t>(std::min<std::uint64_t>(rest.triangles, max_triangles));
    rest.first_triangle += taken.triangles;
    rest.triangles -= taken.triangles;
    max_triangles -= taken.triangles;
    remaining_ -= taken.triangles;
    if (rest.triangles == 0) ++next_;
  }
  return batch_;
}

}  // namespace isobrick
