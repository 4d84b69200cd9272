#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <isobrick/mesh.h>
#include <isobrick/vec.h>
#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {

/// Smallest and largest of what was included, axis by axis.
struct Bounds3f {
  Vec3f lo, hi;
  bool empty = true;

  void include(std::span<const Vec3f> positions);
  void include(const Bounds3f& other);
};

/// One of the attributes of a vertex as it is stored.
struct GlbField {
  std::string name;                   ///< as glTF has it: "POSITION"
  std::size_t offset = 0, bytes = 0;  ///< in the row; with what aligns the next one
  int component = 0;                  ///< kind of its numbers, as glTF has it
  const char* type = "VEC3";
  bool normalized = false;
};

/// How a glTF file holds vertices: rows of float, or of 16 bits on a grid. glTF measures in
/// metres: where the unit is known, the scene's node scales by what one is in metres, and the
/// asset's extras name it ("unit": "micrometer"). The vertices stay in the unit.
struct GlbVertices {
  bool normals = false, quantized = false;
  /// The node turns z, which is up in 3D Tiles, to y, which is up in glTF.
  bool turns_z_up = false;
  std::array<double, 3> colour{0.87, 0.8, 0.7};  ///< of the material, in linear light
  Vec3d origin;                                  ///< of the grid, world units
  double step = 1;  ///< of the grid, the same along all axes, so that normals stay right
  std::string unit = {};
  /// Names of vertex attributes, which become custom ones in capitals: "_TEMPERATURE". Their floats
  /// end each row.
  std::vector<std::string> attributes = {};
  /// Colours of vertices (COLOR_0), in linear light of 16 bits. Before they are stored, four bytes
  /// of sRGB end each row. The material is white then.
  bool colours = false;
  std::string name = {};  ///< of the node and of the mesh; empty: none

  /// The grid that covers `bounds`.
  void set_grid(const Bounds3f& bounds);
  std::size_t row_bytes() const;
  /// The same before it is quantized, as append_rows() writes it.
  std::size_t float_row_bytes() const;
  /// The part of it before the attributes.
  std::size_t vector_bytes() const;
  /// What a row consists of; positions first.
  std::vector<GlbField> fields() const;
  /// A position as stored; whole numbers on a grid.
  Vec3f stored(Vec3f position) const;
  Bounds3f stored(const Bounds3f& bounds) const;
  /// Writes rows as append_rows() has them in this form, row_bytes() each. Returns the bounds of
  /// their positions as stored.
  Bounds3f store(std::span<const std::byte> rows, std::byte* to) const;
  /// The bounds of positions that the first of fields() holds, side by side.
  Bounds3f bounds_of_positions(std::span<const std::byte> positions) const;
  /// Appends rows so, any number of them.
  Bounds3f append(FileWriter& out, std::span<const std::byte> rows) const;
};

/// Bytes of a buffer.
struct BufferRange {
  std::uint64_t offset = 0, bytes = 0;
};

/// One primitive: vertices, then triangles of UInt32, in a buffer of its own.
struct GlbPrimitive {
  std::uint64_t vertices = 0, triangles = 0;
  Bounds3f bounds;  ///< of the positions as stored
  std::string uri;  ///< of its buffer; empty: the file's own
  std::uint64_t vertex_bytes = 0;
  /// Of a primitive that is compressed (EXT_meshopt_compression): each of GlbVertices::fields(),
  /// then the triangles. Its buffer is the file's own, which all such primitives share, or one of
  /// its own at `uri`. Empty: not compressed.
  std::vector<BufferRange> compressed = {};
  /// Bytes of it as vertices and triangles.
  std::uint64_t bytes() const { return vertex_bytes + triangles * 3 * sizeof(std::uint32_t); }
};

/// A part of sRGB as one of linear light, to four decimals, which are the same with every math
/// library.
double linear_light(std::uint8_t srgb);

/// The scene's JSON. Either all primitives are compressed or none is.
std::string glb_json(const GlbVertices& vertices, std::span<const GlbPrimitive> primitives);

/// What precedes the buffer: the file's header, the JSON padded to a multiple of
/// four, and the header of the buffer unless that is empty.
std::string glb_start(std::string json, std::uint64_t buffer_bytes);

/// `text` as it may stand in a URI.
std::string percent_encoded(std::string_view text);

}  // namespace isobrick
