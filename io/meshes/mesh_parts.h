#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include <isobrick/mesh.h>

// How a welded mesh is cut into parts with numbers of their own. The triangles are cut into runs of
// one length, and a run into parts. Runs do not depend on each other, so several processes may
// write them. Where the cuts lie depends on nothing but the mesh.

namespace isobrick::inline v0 {

/// A welded mesh in two files.
struct StoredMesh {
  using ReadAt = std::function<void(std::uint64_t offset, std::span<std::byte> bytes)>;
  ReadAt rows;       ///< of vertices, as append_rows() writes them
  ReadAt triangles;  ///< three numbers each, of 4 bytes, or of 8 if `wide`
  std::size_t row_bytes = 0;
  bool wide = false;
};

/// Triangles that follow each other, and the vertices that they name first.
struct MeshRun {
  std::uint64_t first_triangle = 0, triangles = 0;
  std::uint64_t first_vertex = 0, end_vertex = 0;
};

/// Finds the runs of a mesh whose triangles come by and by.
class RunFinder {
 public:
  explicit RunFinder(std::uint64_t run_triangles) : run_triangles_(run_triangles) {}

  /// Of a run, the largest number that its triangles name, plus one.
  struct End {
    std::uint64_t run = 0, vertex = 0;
  };

  /// The triangles from number `first` on.
  void add(std::uint64_t first, std::span<const Triangle> triangles);
  void add(std::uint64_t first, std::span<const WideTriangle> triangles);
  /// What another one found in other triangles of the mesh.
  void add(std::span<const End> ends);

  /// What was found so far, in the order of the runs.
  std::vector<End> ends() const;
  /// All runs of the mesh; one where it has no triangle.
  std::vector<MeshRun> runs(MeshSize mesh) const;

 private:
  template <class AnyTriangle>
  void add_any(std::uint64_t first, std::span<const AnyTriangle> triangles);
  void note(std::uint64_t run, std::uint64_t end);

  std::uint64_t run_triangles_;
  std::vector<std::uint64_t> ends_;  ///< 0: nothing was added
};

/// Triangles of a run with all the vertices that they name. A vertex that several parts name is
/// repeated in each; every vertex is the own one of exactly one part.
struct MeshPart {
  std::uint64_t run = 0;
  std::uint32_t number = 0;  ///< in the run
  std::uint64_t first_triangle = 0, triangles = 0;
  std::uint64_t first_vertex = 0, own_vertices = 0;
  std::span<const std::uint64_t> borrowed;  ///< of parts before, ascending

  std::uint64_t vertices() const { return own_vertices + borrowed.size(); }
  /// The number in this part, where the borrowed ones follow the own ones, of a
  /// vertex that the part has.
  std::uint32_t local(std::uint64_t vertex) const;
};

/// Calls `take` for the parts of run number `number`, in order. Mostly it is one part; one that
/// borrows more vertices than an eighth of `run_triangles` ends sooner.
void for_each_part(const StoredMesh& mesh, std::uint64_t number, const MeshRun& run,
                   std::uint64_t run_triangles, const std::function<void(const MeshPart&)>& take);

/// Bytes that for_each_part holds at most.
std::uint64_t part_memory(std::uint64_t run_triangles);

/// Calls take(bytes) for batches of whole rows, at most FileWriter::kBuffer bytes
/// each, that make up the part's vertices in its order.
void for_each_row_batch(const StoredMesh& mesh, const MeshPart& part,
                        const std::function<void(std::span<const std::byte>)>& take);

/// Calls take(triangles) for batches of the part's triangles, with its own numbers.
void for_each_triangle_batch(const StoredMesh& mesh, const MeshPart& part,
                             const std::function<void(std::span<const Triangle>)>& take);

}  // namespace isobrick
