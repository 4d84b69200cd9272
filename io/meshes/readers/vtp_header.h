#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace isobrick {

/// An array of a VTK file: its element's attributes, and where its own text begins.
struct VtkArray {
  std::map<std::string, std::string> attributes;
  std::uint64_t content = 0;

  /// An attribute, or `fallback` where it lacks it.
  std::string get(const char* name, const char* fallback = "") const;
};

/// Points and the polygons between them.
struct VtpPiece {
  std::uint64_t points = 0, polygons = 0, strips = 0;
  std::vector<VtkArray> positions, polygon_arrays, point_data;
  std::string normals, scalars;  ///< names of these among the point data, or empty
};

/// What the XML of a VTK PolyData file (.vtp) or its index of parts (.pvtp) says.
struct VtpHeader {
  VtkArray file, appended;  ///< attributes of <VTKFile> and <AppendedData>
  std::uint64_t data = 0;   ///< where the offsets of appended arrays count from
  std::vector<VtpPiece> pieces;
  std::vector<std::string> sources;  ///< of a .pvtp: the names of its parts
  std::optional<VtkArray> unit;      ///< of the field data

  bool swapped() const { return file.get("byte_order", "LittleEndian") == "BigEndian"; }
};

/// Reads the XML up to its appended data. Throws Error for what is no such file.
VtpHeader parse_vtp_header(const std::string& path, std::span<const std::byte> bytes);

[[noreturn]] void fail_vtp(const std::string& path, const std::string& what);

}  // namespace isobrick
