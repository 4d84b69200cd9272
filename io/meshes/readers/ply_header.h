#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/bytes/mapped_file.h"
#include "io/meshes/readers/mesh_parts_reader.h"

namespace isobrick::inline v0 {

/// A property of a PLY file's elements.
struct PlyProperty {
  std::string name;
  NumberKind kind{};
  bool list = false;
  NumberKind count_kind{};
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;

  /// Bytes of one in a binary file, if all are alike.
  std::optional<std::uint64_t> row_bytes() const;
  /// Where the properties of these names are, if it has all three and none is a list.
  std::optional<std::array<std::size_t, 3>> find(
      const std::array<std::string_view, 3>& names) const;
  /// Where red, green and blue are, if it has all three.
  std::optional<std::array<std::size_t, 3>> find_colours() const;
  /// Where the list of a face's vertices is; throws Error if there is none.
  std::size_t find_corners(const std::string& path) const;
};

struct PlyHeader {
  bool text = false;
  bool swapped = false;  ///< binary numbers are in the other byte order
  std::vector<PlyElement> elements;
  std::size_t bytes = 0;
  std::uint64_t lines = 0;
  std::string unit;  ///< as unit_name() has it, or empty
};

/// Throws Error for a header that is damaged, as all readers of PLY do.
PlyHeader parse_ply_header(const std::string& path, std::string_view text);

/// By what numbers of colours of this kind are scaled to [0, 1].
double ply_colour_scale(NumberKind kind);

[[noreturn]] void fail_ply(const std::string& path, const std::string& what);

/// The body of a file whose numbers are text.
std::unique_ptr<MeshFile> read_text_ply(const std::string& path, std::shared_ptr<MappedFile> file,
                                        const PlyHeader& header);

}  // namespace isobrick
