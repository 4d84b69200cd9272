#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

#include <isobrick/mesh.h>

// The codecs of EXT_meshopt_compression, by the library meshoptimizer. Without loss, and the bytes
// depend on nothing but the input.

namespace isobrick::inline v0 {

inline constexpr const char* kMeshoptExtension = "EXT_meshopt_compression";

/// Throws UsageError in a build without the library.
void check_meshopt();

/// What a codec made.
struct EncodedBytes {
  std::unique_ptr<std::byte[]> bytes;
  std::size_t size = 0;
  std::span<const std::byte> span() const { return {bytes.get(), size}; }
};

/// Encodes rows of `stride` bytes, a multiple of 4 up to 256 (mode ATTRIBUTES).
EncodedBytes encode_rows(std::span<const std::byte> rows, std::size_t stride);
/// Encodes triangles whose corners are below `vertices` (mode TRIANGLES). Their order stays; the
/// decoder may turn the corners of one. The fewest bytes are those of vertices in the order in
/// which triangles first name them.
EncodedBytes encode_triangles(std::span<const Triangle> triangles, std::size_t vertices);
/// Bytes that an encoder makes at most.
std::size_t max_encoded_rows(std::size_t rows, std::size_t stride);
std::size_t max_encoded_triangles(std::size_t triangles, std::size_t vertices);

/// How a view of a glTF file is compressed, by the names that the extension has for it.
struct MeshoptView {
  std::string_view mode;             ///< ATTRIBUTES, TRIANGLES or INDICES
  std::string_view filter = "NONE";  ///< of attributes: NONE, OCTAHEDRAL, QUATERNION, EXPONENTIAL
  std::size_t count = 0, stride = 0;
};

/// Decodes count x stride bytes. False for what is no such view or is damaged. Throws as
/// check_meshopt() does.
bool decode_meshopt(const MeshoptView& view, std::span<const std::byte> encoded, std::byte* to);

}  // namespace isobrick
