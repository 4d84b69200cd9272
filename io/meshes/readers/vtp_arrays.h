#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <isobrick/scalar.h>
#include "io/bytes/byte_stream.h"
#include "io/meshes/readers/mesh_parts_reader.h"
#include "io/meshes/readers/vtp_header.h"

namespace isobrick {

/// Numbers side by side in mapped memory.
struct NumberArray {
  const std::byte* first = nullptr;
  std::uint64_t count = 0;
  NumberKind kind{};
  bool swapped = false;

  double at(std::uint64_t i) const { return load_number(first + i * size_of(kind), kind, swapped); }
};

/// The arrays of a VTK file. Those that lie there as they are stay there; text, base64 and zlib
/// are unpacked into nameless files.
class VtpArrays {
 public:
  /// All must live as long; `keep` gets the files.
  VtpArrays(const std::string& path, std::span<const std::byte> bytes, const VtpHeader& header,
            std::vector<std::shared_ptr<const void>>& keep)
      : path_(path), bytes_(bytes), header_(header), keep_(keep) {}

  /// Throws Error for an array that is damaged or of a kind that is not read.
  NumberArray numbers(const VtkArray& array) const;
  /// An array of characters up to the first zero, `most` at most.
  std::string text(const VtkArray& array, std::size_t most) const;

 private:
  struct Content {
    std::unique_ptr<ByteStream> bytes = {};  ///< null: they lie in the file
    std::span<const std::byte> in_place = {};
    std::uint64_t size = ~std::uint64_t{0};  ///< of the bytes, at most
    bool native = false;                     ///< numbers of text are of this machine's byte order

    /// The next of the bytes, or none at their end.
    std::size_t read(std::span<std::byte> out);
  };

  Content open(const VtkArray& array, ScalarType type_of_text) const;
  std::span<const std::byte> encoded(const VtkArray& array) const;
  std::unique_ptr<ByteStream> unpacked(std::span<const std::byte> encoded, bool base64) const;
  std::uint64_t read_size(ByteStream& stream) const;
  std::size_t size_bytes() const;

  const std::string& path_;
  std::span<const std::byte> bytes_;
  const VtpHeader& header_;
  std::vector<std::shared_ptr<const void>>& keep_;
};

}  // namespace isobrick
