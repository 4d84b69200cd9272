#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <isobrick/mesh.h>
#include "io/bytes/output_file.h"

namespace isobrick::inline v0 {

/// A VTK PolyData file (.vtp) of one piece: XML, then the arrays appended raw,
/// little endian, each behind its length in bytes as UInt64: points, normals,
/// attributes, global ids, connectivity, offsets. A unit is a string in the field data, named
/// "unit".
struct VtpLayout {
  MeshSize size;
  bool normals = false;
  std::string unit = {};
  std::vector<std::string> attributes = {};  ///< names of the arrays of a float a point
  /// Numbers of the points in the whole mesh, Int64: VTK's global ids.
  bool global_ids = false;
  /// Numbers are Int64 even where fewer bits would do.
  bool has_wide_numbers = false;

  /// Numbers are Int32 mostly where they fit, as VTK holds them, and Int64 otherwise.
  bool wide() const;
  /// All that comes before the points; its length does not depend on the sizes.
  std::string header() const;
  std::uint64_t point_bytes() const { return size.vertices * sizeof(Vec3f); }
  std::uint64_t attribute_bytes() const { return size.vertices * sizeof(float); }
  std::uint64_t global_id_bytes() const { return size.vertices * sizeof(std::int64_t); }
  std::uint64_t connectivity_bytes() const;
  std::uint64_t offset_bytes() const;
};

/// The name of the array of global ids.
inline constexpr std::string_view kGlobalIds = "GlobalPointIds";

/// The length that precedes an array.
void append_length(FileWriter& out, std::uint64_t bytes);

/// Appends vertex numbers as the layout's type.
void append_connectivity(FileWriter& out, const VtpLayout& layout,
                         std::span<const Triangle> triangles);

/// Appends the array of offsets with its length, and the end of the file.
void append_vtp_end(FileWriter& out, const VtpLayout& layout);

}  // namespace isobrick
