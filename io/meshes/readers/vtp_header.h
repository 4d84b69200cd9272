#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "io/vtk/vtk_file.h"

namespace isobrick::inline v0 {

/// Points and the polygons between them.
struct VtpPiece {
  std::uint64_t points = 0, polygons = 0, strips = 0;
  std::vector<VtkElement> positions, polygon_arrays, point_data;
  std::string normals, scalars;  ///< names of these among the point data, or empty
};

/// The XML of a VTK PolyData file (.vtp) or its index of parts (.pvtp).
struct VtpHeader {
  VtkHeader vtk;
  std::vector<VtpPiece> pieces;
  std::vector<std::string> sources;  ///< of a .pvtp: the names of its parts
  std::optional<VtkElement> unit;    ///< of the field data
};

/// `bytes` are those of the file, and must outlive it.
VtkFile vtp_file(const std::string& path, std::span<const std::byte> bytes);

/// Reads the XML up to its appended data. Throws Error for what is no such file.
VtpHeader parse_vtp_header(const VtkFile& file);

[[noreturn]] void fail_vtp(const std::string& path, const std::string& what);

}  // namespace isobrick
