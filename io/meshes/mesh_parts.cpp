#include "io/meshes/mesh_parts.h"

#include <algorithm>
#include <memory>
#include <vector>

namespace isobrick::inline v0 {
namespace {

constexpr std::uint64_t kRun = FileWriter::kBuffer / sizeof(Triangle);
/// Triangles whose vertices are gathered at a time.
constexpr std::uint64_t kGatheredRun = std::uint64_t{1} << 14;

/// Calls f(run) for runs of triangles [first, first + count) of the file, until it returns false;
/// f may change them.
template <class F>
void read_triangles(FileWriter& file, std::uint64_t first, std::uint64_t count,
                    std::uint64_t run_triangles, F&& f) {
  std::vector<Triangle> run(static_cast<std::size_t>(std::min(count, run_triangles)));
  for (const std::uint64_t end = first + count; first < end; first += run.size()) {
    run.resize(static_cast<std::size_t>(std::min(run_triangles, end - first)));
    file.read_back(first * sizeof(Triangle), std::as_writable_bytes(std::span(run)));
    if (!f(std::span<Triangle>(run))) return;
  }
}

std::uint64_t max_borrowed(std::uint64_t part_triangles) { return part_triangles / 8; }

void sort_unique(std::vector<std::uint32_t>& numbers) {
  std::sort(numbers.begin(), numbers.end());
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
}

/// Gathers the part's vertices: how many are its own, and which are not.
class VertexCollector {
 public:
  explicit VertexCollector(std::uint64_t first_vertex) : first_(first_vertex), end_(first_vertex) {}

  void add(std::span<const Triangle> triangles) {
    for (const Triangle& triangle : triangles)
      for (const std::uint32_t vertex : triangle) {
        if (vertex < first_)
          borrowed_.push_back(vertex);
        else
          end_ = std::max(end_, std::uint64_t{vertex} + 1);
      }
    // Each is named some six times.
    if (borrowed_.size() > 2 * distinct_ + 3 * kGatheredRun) {
      sort_unique(borrowed_);
      distinct_ = borrowed_.size();
    }
  }
  /// Of the vertices borrowed, those that are known to be distinct.
  std::size_t distinct() const { return distinct_; }
  const std::vector<std::uint32_t>& borrowed() {
    sort_unique(borrowed_);
    return borrowed_;
  }
  std::uint64_t end() const { return end_; }

 private:
  std::uint64_t first_, end_;
  std::vector<std::uint32_t> borrowed_;
  std::size_t distinct_ = 0;
};

}  // namespace

std::uint32_t MeshPart::local(std::uint32_t vertex) const {
  if (vertex >= first_vertex) return static_cast<std::uint32_t>(vertex - first_vertex);
  const auto rank = std::lower_bound(borrowed.begin(), borrowed.end(), vertex) - borrowed.begin();
  return static_cast<std::uint32_t>(own_vertices + static_cast<std::uint64_t>(rank));
}

void for_each_part(FileWriter& triangles, MeshSize mesh, std::uint64_t part_triangles,
                   const std::function<void(const MeshPart&)>& take) {
  MeshPart part;
  do {
    part.triangles = std::min(part_triangles, mesh.triangles - part.first_triangle);
    VertexCollector collector(part.first_vertex);
    std::uint64_t gathered = 0;
    read_triangles(triangles, part.first_triangle, part.triangles, kGatheredRun,
                   [&](std::span<const Triangle> run) {
                     collector.add(run);
                     gathered += run.size();
                     return collector.distinct() <= max_borrowed(part_triangles);
                   });
    part.triangles = gathered;
    const bool last = part.first_triangle + part.triangles == mesh.triangles;
    // Vertices that no triangle names go with the last one.
    const std::uint64_t end = last ? mesh.vertices : collector.end();
    part.own_vertices = end - part.first_vertex;
    part.borrowed = collector.borrowed();
    take(part);
    part.first_triangle += part.triangles;
    part.first_vertex = end;
  } while (part.first_triangle < mesh.triangles);
}

std::uint64_t part_memory(std::uint64_t part_triangles) {
  // Numbers are sorted out when there are twice as many as distinct ones and a run more. The vector
  // may have twice the room that it needs.
  const std::uint64_t run = 3 * std::min(part_triangles, kGatheredRun);
  return 2 * sizeof(std::uint32_t) * (2 * (max_borrowed(part_triangles) + run) + 2 * run);
}

void for_each_row_run(const VertexRows& rows, const MeshPart& part,
                      const std::function<void(std::span<const std::byte>)>& take) {
  const std::uint64_t most = FileWriter::kBuffer / rows.row_bytes;
  const auto buffer = std::make_unique_for_overwrite<std::byte[]>(most * rows.row_bytes);
  std::uint64_t filled = 0;
  const auto hand_over = [&] {
    take({buffer.get(), static_cast<std::size_t>(filled) * rows.row_bytes});
    filled = 0;
  };
  const auto add = [&](std::uint64_t first, std::uint64_t count) {
    while (count > 0) {
      const std::uint64_t now = std::min(count, most - filled);
      rows.file.read_back(first * rows.row_bytes, {buffer.get() + filled * rows.row_bytes,
                                                   static_cast<std::size_t>(now) * rows.row_bytes});
      filled += now;
      first += now;
      count -= now;
      if (filled == most) hand_over();
    }
  };
  add(part.first_vertex, part.own_vertices);
  for (auto from = part.borrowed.begin(); from != part.borrowed.end();) {
    auto to = from + 1;
    while (to != part.borrowed.end() && *to == *(to - 1) + 1) ++to;
    add(*from, static_cast<std::uint64_t>(to - from));
    from = to;
  }
  if (filled > 0) hand_over();
}

void for_each_triangle_run(FileWriter& triangles, const MeshPart& part,
                           const std::function<void(std::span<const Triangle>)>& take) {
  read_triangles(triangles, part.first_triangle, part.triangles, kRun,
                 [&](std::span<Triangle> run) {
                   for (Triangle& triangle : run)
                     for (std::uint32_t& vertex : triangle) vertex = part.local(vertex);
                   take(run);
                   return true;
                 });
}

}  // namespace isobrick
