#pragma once

#include <cstdint>
#include <string>

#include <isobrick/array_view.h>
#include <isobrick/scalar.h>
#include <isobrick/transform.h>
#include <isobrick/volume_request.h>

namespace isobrick {

enum class VtiEncoding : std::uint8_t { ascii, base64, raw };

/// What the XML of a VTK image file (`.vti`) says of one of its arrays.
struct VtiHeader {
  ArrayView view;
  ScalarType type = ScalarType::u8;
  Transform transform;
  ByteOrder order = ByteOrder::little;
  int size_bytes = 4;       ///< of the numbers of bytes before an array, 4 or 8
  bool compressed = false;  ///< in zlib blocks
  VtiEncoding encoding = VtiEncoding::raw;
  std::uint64_t begin = 0;  ///< where the array's bytes or text begin in the file
};

/// Reads a file as far as it takes to find its array `array`; empty means that
/// which is marked as the scalars, or the only one. Point data go before cell
/// data, whose samples lie at the cells' centres. Throws UsageError for what is
/// no such file and for what is not supported.
VtiHeader parse_vti_header(const std::string& path, const std::string& array,
                           const Selection& selection);

}  // namespace isobrick
