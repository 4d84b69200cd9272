#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory_resource>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <isobrick/api.h>
#include <isobrick/pod_buffer.h>
#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// Three vertex numbers, counter-clockwise seen from outside (see Inside).
using Triangle = std::array<std::uint32_t, 3>;
/// The same in a mesh of more vertices than 32 bits number.
using WideTriangle = std::array<std::uint64_t, 3>;
/// Vertices that numbers of 32 bits can name.
inline constexpr std::uint64_t kMaxNarrowVertices = 0xffff'ffff;

/// sRGB, a byte each; the fourth is not used.
using VertexColour = std::array<std::uint8_t, 4>;

/// How triangles name their vertices.
enum class Indexing : std::uint8_t {
  /// One vertex per active lattice edge in the whole mesh; numbers count
  /// from the mesh's first vertex and may point into earlier chunks.
  welded,
  /// Every chunk stands alone: numbers count from the chunk's first vertex,
  /// vertices on the faces between tiles are repeated. For formats without
  /// vertex sharing (STL) and for renderers.
  chunk_local,
};

/// A number at each vertex, such as a sample of another volume. A view, as MeshChunk is.
struct VertexAttribute {
  std::string_view name;          ///< as MeshHeader::attributes has it
  std::span<const float> values;  ///< one a vertex; NaN: not known
};

/// A piece of a mesh, in world space. A view: valid until the call returns.
struct MeshChunk {
  std::uint64_t first_vertex = 0;              ///< number of vertices in the chunks before
  std::span<const Vec3f> positions;            ///< of the vertices
  std::span<const Vec3f> normals;              ///< unit length, outward; empty or one a position
  std::span<const Triangle> triangles;         ///< numbered by MeshSink::indexing()
  std::span<const VertexColour> colours = {};  ///< empty or one a position
  /// Those of MeshHeader::attributes, in that order.
  std::span<const VertexAttribute> attributes = {};
  /// In place of `triangles` where MeshHeader::wide says so.
  std::span<const WideTriangle> wide_triangles = {};
};

struct MeshFileOptions;
class Progress;

/// A mesh in memory. Reused, it allocates nothing. With a memory resource, which must outlive it,
/// all arrays lie in the caller's memory.
struct ISOBRICK_API Mesh {
  PodBuffer<Vec3f> positions;     ///< of the vertices, in world space
  PodBuffer<Vec3f> normals;       ///< unit length, outward; empty or one a position
  PodBuffer<Triangle> triangles;  ///< numbers of vertices
  std::string unit;               ///< of the positions, as unit_name() has it; empty: unknown

  /// Empty, in memory of the process.
  Mesh() = default;
  /// Empty, in memory of `memory`.
  explicit Mesh(std::pmr::memory_resource* memory)
      : positions(memory), normals(memory), triangles(memory) {}

  /// Empties the mesh and keeps the memory.
  void clear() {
    positions.clear();
    normals.clear();
    triangles.clear();
  }
  /// A view of all of it, as the chunk after `first_vertex` vertices.
  MeshChunk chunk(std::uint64_t first_vertex = 0) const {
    return {first_vertex, positions.span(), normals.span(), triangles.span()};
  }
  /// Writes a mesh file, of the format that the name's extension says. Replaces none: throws
  /// UsageError where it exists, as create_mesh_file() does. Defined in isobrick::meshes.
  void save(const std::filesystem::path& path) const;
  /// The same with options.
  void save(const std::filesystem::path& path, const MeshFileOptions& options) const;
  /// The same with reports of progress. What `progress` throws ends it and leaves no file.
  void save(const std::filesystem::path& path, const MeshFileOptions& options,
            Progress& progress) const;
  /// The same with vertex attributes, by names as of check_attribute_names(). Throws UsageError
  /// where one has not a value a vertex, or the format holds none.
  void save(const std::filesystem::path& path, const MeshFileOptions& options, Progress& progress,
            std::span<const VertexAttribute> attributes) const;
};

/// Of what a mesh consists.
struct MeshSize {
  std::uint64_t vertices = 0;   ///< number of vertices
  std::uint64_t triangles = 0;  ///< number of triangles
};

/// A box in world space.
struct MeshBounds {
  Vec3d lo;  ///< the smallest coordinates
  Vec3d hi;  ///< the largest coordinates
};

/// What is known before the first chunk.
struct MeshHeader {
  bool has_normals = false;  ///< whether every chunk has normals
  Vec3d world_lo;            ///< the smallest coordinates of the volume, not of the mesh
  Vec3d world_hi;            ///< the largest coordinates of the volume
  /// Bounds of the blocks that the surface passes through, within the region; nothing: not known.
  std::optional<MeshBounds> surface = {};
  std::string unit = {};  ///< of all coordinates, as unit_name() has it; empty: unknown
  /// Names of the vertex attributes that every chunk has. Sinks without a place for them ignore
  /// them, as filters and MemorySink do.
  std::vector<std::string> attributes = {};
  /// The mesh has more vertices than 32 bits number, and chunks have `wide_triangles`. Only for
  /// sinks that take them.
  bool wide = false;
  /// Whether every chunk has colours. PLY, OBJ and GLB hold them; others ignore them.
  bool has_colours = false;
};

/// Takes a mesh chunk by chunk. Calls come from one thread at a time, in order.
class ISOBRICK_API MeshSink {
 public:
  virtual ~MeshSink() = default;

  /// How the chunks that it takes name their vertices.
  virtual Indexing indexing() const = 0;
  /// Whether it takes meshes with MeshHeader::wide, as formats in parts do.
  virtual bool takes_wide() const { return false; }
  /// Called once, before the first chunk. Throws Error when the file cannot be written.
  virtual void begin(const MeshHeader& header) = 0;
  /// Takes the next chunk, which it copies or writes. Throws Error when the file cannot be written.
  virtual void write(const MeshChunk& chunk) = 0;
  /// The mesh is whole: only now may it appear under its final name.
  /// Not called after a failure; the destructor then removes what was written.
  virtual void finish() = 0;
  /// Bytes written so far, to scratch files as well; those of the mesh when it is finished.
  virtual std::uint64_t bytes() const = 0;
  /// Bytes that it holds at most from begin to finish, beyond a few buffers of FileWriter::kBuffer;
  /// afterwards it holds none.
  virtual std::uint64_t memory() const { return 0; }
};

}  // namespace isobrick
