#pragma once

#include <cstdint>
#include <memory>

#include <isobrick/scalar.h>
#include "io/bytes/byte_stream.h"
#include "io/vtk/vtk_file.h"

namespace isobrick::inline v0 {

enum class VtkEncoding : std::uint8_t { ascii, base64, raw };

/// Where an array lies in its file, and how its numbers are stored.
struct VtkArrayLayout {
  VtkEncoding encoding = VtkEncoding::raw;
  bool compressed = false;  ///< in zlib blocks
  bool swap = false;        ///< its numbers are of the other byte order; text is of neither
  int size_bytes = 4;       ///< of the numbers of bytes before it, 4 or 8
  std::uint64_t begin = 0;  ///< of its bytes or text, without blanks before them

  /// Whether the numbers lie in the file as they are, from first_number() on.
  bool plain() const { return encoding == VtkEncoding::raw && !compressed; }
  std::uint64_t first_number() const { return begin + static_cast<std::uint64_t>(size_bytes); }
};

/// The layout of an array by its element and the file's. Fails for what is not supported.
VtkArrayLayout vtk_array_layout(const VtkFile& file, const VtkHeader& header,
                                const VtkElement& array);

/// The numbers of an array, side by side.
struct VtkNumbers {
  std::unique_ptr<ByteStream> stream;
  std::uint64_t bytes =
      ~std::uint64_t{0};  ///< as the file states them; the largest where it doesn't
};

/// Decodes an array. Text becomes numbers of `type` as they are stored, in this machine's byte
/// order.
VtkNumbers open_vtk_array(const VtkFile& file, const VtkArrayLayout& layout, ScalarType type);

}  // namespace isobrick
