#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include <isobrick/api.h>
#include <isobrick/mesh.h>

namespace isobrick::inline v0 {

/// What a mesh measures, in world units.
struct MeshMeasure {
  std::uint64_t vertices = 0;    ///< that triangles name
  std::uint64_t triangles = 0;   ///< number of triangles
  std::uint64_t components = 0;  ///< parts of which no two share a vertex
  /// Sides of triangles without a reverse: a side from a to b has one where another triangle has a
  /// side from b to a. Counted exactly.
  std::uint64_t open_sides = 0;
  /// Vertices less sides plus triangles: 2 a sphere, 0 a torus. Two opposite sides count as one,
  /// and so does an open one. Sheets that touch along a side have a side each.
  std::int64_t euler_number = 0;
  double area = 0;  ///< of all triangles
  /// Enclosed, by the divergence theorem: negative where triangles are clockwise seen from outside.
  /// Nothing where the mesh is open, for then it encloses none.
  std::optional<double> volume = {};
  std::optional<MeshBounds> bounds = {};  ///< of the vertices; nothing where there is none
  std::string unit = {};                  ///< of lengths, as unit_name() has it; empty: unknown

  /// Whether every side has its reverse. So has every side of a mesh without triangles.
  bool is_closed() const { return open_sides == 0; }
};

/// What is done to a mesh on its way to a sink, in the order of the members.
struct MeshFilterOptions {
  /// Drops components with fewer triangles; 0 and 1 drop none. Components are parts of which no two
  /// share a vertex.
  std::uint64_t min_component = 0;
  /// Keeps so many components, those with most triangles; of equal ones those with the smaller
  /// first vertex. 0 keeps all.
  std::uint64_t largest = 0;
  /// Iterations of Taubin's λ|μ smoothing, each a step that shrinks and one that swells. Vertices
  /// on open sides stay where they are. Normals become those of the triangles, weighted by area.
  int smooth = 0;
  /// Of the smoothing: what varies along the surface more than this is smoothed away. 0 is what
  /// does not vary, 2 is what alternates from vertex to vertex. Above 0, at most 0.8.
  double pass_band = 0.1;
  /// Simplifies to so many triangles, a part of those that there are in (0, 1]; 1: all. Edges
  /// collapse onto one of their ends, by the quadric error (Garland & Heckbert 1997). Flat parts
  /// lose more than others. The topology and the borders of the surface stay: components, handles
  /// and holes are those from before. More are left where these or `max_error` are in the way.
  double simplify_ratio = 1;
  /// The same as a number of triangles; in place of the ratio where it is not 0.
  std::uint64_t simplify_triangles = 0;
  /// Of the simplification: how far, in world units, vertices and centres of the triangles before
  /// may be from the surface after it. 0: any. Without a goal it simplifies as far as this permits.
  double max_error = 0;
  /// Unit of the mesh that leaves, such as "millimeter"; empty: that of the mesh that enters.
  /// begin() throws UsageError if that one is not known. Lengths above are in the unit before,
  /// measures in the unit after.
  std::string unit = {};
  bool measure = false;  ///< MeshFilter::measure()
  /// Takes a welded mesh for any sink, also where there is nothing to do.
  bool takes_welded = false;
  int threads = 0;  ///< of simplification, 0: all cores; never shows in the mesh
  /// Bytes that all filters hold at most; what does not fit lies in scratch files. Simplification
  /// takes 120 MiB more for the groups that it works on.
  std::uint64_t memory = std::uint64_t{256} << 20;
  /// The file beside which scratch files lie; "-": in the folder of temporary files.
  std::filesystem::path scratch_beside = "-";
  /// Ends the operation with Cancelled, soon after a stop is requested on any thread.
  std::stop_token cancel = {};
  /// Hears of what takes long in finish(), within the stage of the extraction. It must outlive the
  /// filter and is called by the thread that calls finish(). Null: nobody. Not for filters that
  /// several threads may finish, as one extraction of several surfaces does.
  Progress* progress = nullptr;

  /// Whether the mesh that leaves may be another one than that which enters.
  bool changes_mesh() const { return smooth > 0 || makes_smaller(); }
  /// Whether triangles are to become fewer.
  bool simplifies() const { return simplify_ratio < 1 || simplify_triangles > 0 || max_error > 0; }
  /// Whether the mesh that leaves is mostly smaller than that which enters.
  bool makes_smaller() const { return min_component > 1 || largest > 0 || simplifies(); }
  /// Whether there is anything to do.
  bool any() const { return changes_mesh() || measure || !unit.empty(); }
};

/// Throws UsageError for options that make no sense.
ISOBRICK_API void check_filters(const MeshFilterOptions& options);

/// Bytes that scratch files take at most for a mesh of this size.
ISOBRICK_API std::uint64_t filter_scratch_bytes(const MeshFilterOptions& options, MeshSize mesh,
                                                bool has_normals);

/// Passes a mesh on to another sink, filtered, whatever its size: see MeshFilterOptions::memory.
/// The mesh that leaves depends on nothing but the mesh that enters and the options, not on its
/// chunks or the memory. Sinks of both kinds of Indexing get what they take.
///
/// Filters that change the mesh write to the sink when the whole mesh is there, in finish().
class ISOBRICK_API MeshFilter final : public MeshSink {
 public:
  /// `sink` must outlive it. Throws as check_filters() does.
  MeshFilter(MeshSink& sink, const MeshFilterOptions& options);
  ~MeshFilter() override;

  /// Welded, but that of the sink where there is nothing to do and `takes_welded` is not set.
  Indexing indexing() const override;
  /// What the sink says, or true where a filter makes the mesh smaller.
  bool takes_wide() const override;
  void begin(const MeshHeader& header) override;
  /// Throws Error for more than kMaxNarrowVertices vertices where MeshHeader::wide is not set.
  void write(const MeshChunk& chunk) override;
  /// Throws Error where the sink does not take as many vertices as are left.
  void finish() override;
  std::uint64_t bytes() const override;
  std::uint64_t memory() const override;

  /// Of the mesh that left, after finish().
  MeshSize size() const;
  /// Of the mesh that left, after finish(), if that was requested.
  std::optional<MeshMeasure> measure() const;
  /// Triangles that the simplification aimed at, after finish(): more are left where `max_error`,
  /// or components, handles and borders, which stay, need them. Nothing where only `max_error`
  /// decides.
  std::optional<std::uint64_t> simplify_goal() const;

 private:
  class Stages;
  std::unique_ptr<Stages> stages_;
};

/// Filters a mesh in memory, also one of another program. Both meshes and what the filters hold are
/// in memory; MeshFilterOptions::measure does nothing. Throws as check_filters() does, and
/// UsageError where a triangle names a vertex that is not there or the normals are not as many as
/// the vertices.
ISOBRICK_API Mesh apply_filters(const Mesh& mesh, const MeshFilterOptions& options);

/// Measures a mesh in memory. Throws UsageError where a triangle names a vertex that is not there.
ISOBRICK_API MeshMeasure measure(const Mesh& mesh);

}  // namespace isobrick
