#include "io/meshes/mesh_parts.h"

#include <algorithm>
#include <memory>

#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {
namespace {

/// Triangles whose vertices are gathered at a time.
constexpr std::uint64_t kGatheredBatch = std::uint64_t{1} << 14;

/// Calls f(batch) for batches of triangles [first, first + count), until it returns false.
template <class AnyTriangle, class F>
void read_batches(const StoredMesh& mesh, std::uint64_t first, std::uint64_t count,
                  std::uint64_t batch_triangles, const F& f) {
  std::vector<AnyTriangle> batch(static_cast<std::size_t>(std::min(count, batch_triangles)));
  for (const std::uint64_t end = first + count; first < end; first += batch.size()) {
    batch.resize(static_cast<std::size_t>(std::min(batch_triangles, end - first)));
    mesh.triangles(first * sizeof(AnyTriangle), std::as_writable_bytes(std::span(batch)));
    if (!f(std::span<const AnyTriangle>(batch))) return;
  }
}

template <class F>
void read_triangles(const StoredMesh& mesh, std::uint64_t first, std::uint64_t count,
                    std::uint64_t batch_triangles, const F& f) {
  if (mesh.wide)
    read_batches<WideTriangle>(mesh, first, count, batch_triangles, f);
  else
    read_batches<Triangle>(mesh, first, count, batch_triangles, f);
}

std::uint64_t max_borrowed(std::uint64_t run_triangles) { return run_triangles / 8; }

void sort_unique(std::vector<std::uint64_t>& numbers) {
  std::sort(numbers.begin(), numbers.end());
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
}

/// Gathers the part's vertices: how many are its own, and which are not.
class VertexCollector {
 public:
  explicit VertexCollector(std::uint64_t first_vertex) : first_(first_vertex), end_(first_vertex) {}

  template <class AnyTriangle>
  void add(std::span<const AnyTriangle> triangles) {
    for (const AnyTriangle& triangle : triangles)
      for (const std::uint64_t vertex : triangle) {
        if (vertex < first_)
          borrowed_.push_back(vertex);
        else
          end_ = std::max(end_, vertex + 1);
      }
    // Each is named some six times.
    if (borrowed_.size() > 2 * distinct_ + 3 * kGatheredBatch) {
      sort_unique(borrowed_);
      distinct_ = borrowed_.size();
    }
  }
  /// Of the vertices borrowed, those that are known to be distinct.
  std::size_t distinct() const { return distinct_; }
  const std::vector<std::uint64_t>& borrowed() {
    sort_unique(borrowed_);
    return borrowed_;
  }
  std::uint64_t end() const { return end_; }

 private:
  std::uint64_t first_, end_;
  std::vector<std::uint64_t> borrowed_;
  std::size_t distinct_ = 0;
};

}  // namespace

template <class AnyTriangle>
void RunFinder::add_any(std::uint64_t first, std::span<const AnyTriangle> triangles) {
  while (!triangles.empty()) {
    const std::uint64_t run = first / run_triangles_, left = (run + 1) * run_triangles_ - first;
    const auto batch =
        triangles.first(static_cast<std::size_t>(std::min<std::uint64_t>(left, triangles.size())));
    std::uint64_t most = 0;
    for (const AnyTriangle& triangle : batch)
      for (const std::uint64_t vertex : triangle) most = std::max(most, vertex);
    note(run, most + 1);
    first += batch.size();
    triangles = triangles.subspan(batch.size());
  }
}

void RunFinder::add(std::uint64_t first, std::span<const Triangle> triangles) {
  add_any(first, triangles);
}
void RunFinder::add(std::uint64_t first, std::span<const WideTriangle> triangles) {
  add_any(first, triangles);
}

void RunFinder::add(std::span<const End> ends) {
  for (const End& end : ends) note(end.run, end.vertex);
}

void RunFinder::note(std::uint64_t run, std::uint64_t end) {
  if (ends_.size() <= run) ends_.resize(static_cast<std::size_t>(run) + 1);
  ends_[run] = std::max(ends_[run], end);
}

std::vector<RunFinder::End> RunFinder::ends() const {
  std::vector<End> ends;
  for (std::size_t run = 0; run < ends_.size(); ++run)
    if (ends_[run] > 0) ends.push_back({run, ends_[run]});
  return ends;
}

std::vector<MeshRun> RunFinder::runs(MeshSize mesh) const {
  std::vector<MeshRun> runs;
  MeshRun run;
  do {
    run.triangles = std::min(run_triangles_, mesh.triangles - run.first_triangle);
    run.end_vertex = run.first_vertex;
    if (runs.size() < ends_.size()) run.end_vertex = std::max(run.first_vertex, ends_[runs.size()]);
    runs.push_back(run);
    run.first_triangle += run.triangles;
    run.first_vertex = run.end_vertex;
  } while (run.first_triangle < mesh.triangles);
  // Vertices that no triangle names go with the last one.
  runs.back().end_vertex = mesh.vertices;
  return runs;
}

std::uint32_t MeshPart::local(std::uint64_t vertex) const {
  if (vertex >= first_vertex) return static_cast<std::uint32_t>(vertex - first_vertex);
  const auto rank = std::lower_bound(borrowed.begin(), borrowed.end(), vertex) - borrowed.begin();
  return static_cast<std::uint32_t>(own_vertices + static_cast<std::uint64_t>(rank));
}

void for_each_part(const StoredMesh& mesh, std::uint64_t number, const MeshRun& run,
                   std::uint64_t run_triangles, const std::function<void(const MeshPart&)>& take) {
  MeshPart part{
      .run = number, .first_triangle = run.first_triangle, .first_vertex = run.first_vertex};
  const std::uint64_t end = run.first_triangle + run.triangles;
  do {
    VertexCollector collector(part.first_vertex);
    part.triangles = 0;
    read_triangles(mesh, part.first_triangle, end - part.first_triangle, kGatheredBatch,
                   [&](auto batch) {
                     collector.add(batch);
                     part.triangles += batch.size();
                     return collector.distinct() <= max_borrowed(run_triangles);
                   });
    const bool last = part.first_triangle + part.triangles == end;
    const std::uint64_t end_vertex = last ? run.end_vertex : collector.end();
    part.own_vertices = end_vertex - part.first_vertex;
    part.borrowed = collector.borrowed();
    take(part);
    ++part.number;
    part.first_triangle += part.triangles;
    part.first_vertex = end_vertex;
  } while (part.first_triangle < end);
}

std::uint64_t part_memory(std::uint64_t run_triangles) {
  // Numbers are sorted out when there are twice as many as distinct ones and a batch more. The
  // vector may have twice the room that it needs.
  const std::uint64_t batch = 3 * std::min(run_triangles, kGatheredBatch);
  return 2 * sizeof(std::uint64_t) * (2 * (max_borrowed(run_triangles) + batch) + 2 * batch);
}

void for_each_row_batch(const StoredMesh& mesh, const MeshPart& part,
                        const std::function<void(std::span<const std::byte>)>& take) {
  const std::uint64_t most = FileWriter::kBuffer / mesh.row_bytes;
  const auto buffer = std::make_unique_for_overwrite<std::byte[]>(most * mesh.row_bytes);
  std::uint64_t filled = 0;
  const auto hand_over = [&] {
    take({buffer.get(), static_cast<std::size_t>(filled) * mesh.row_bytes});
    filled = 0;
  };
  const auto add = [&](std::uint64_t first, std::uint64_t count) {
    while (count > 0) {
      const std::uint64_t now = std::min(count, most - filled);
      mesh.rows(first * mesh.row_bytes, {buffer.get() + filled * mesh.row_bytes,
                                         static_cast<std::size_t>(now) * mesh.row_bytes});
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

void for_each_triangle_batch(const StoredMesh& mesh, const MeshPart& part,
                             const std::function<void(std::span<const Triangle>)>& take) {
  std::vector<Triangle> own;
  read_triangles(mesh, part.first_triangle, part.triangles,
                 FileWriter::kBuffer / sizeof(WideTriangle), [&](auto batch) {
                   own.resize(batch.size());
                   for (std::size_t i = 0; i < batch.size(); ++i)
                     for (std::size_t corner = 0; corner < 3; ++corner)
                       own[i][corner] = part.local(batch[i][corner]);
                   take(own);
                   return true;
                 });
}

}  // namespace isobrick
