#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

#include <isobrick/mesh.h>
#include <isobrick/part.h>
#include "core/tile_range.h"

// The bytes of a piece of a mesh; docs/reference/piece_format.md describes them. No files here.

namespace isobrick::inline v0 {

/// What distinguishes pieces of surfaces from those of labels.
struct PieceKey {
  Part part;
  TileRange tiles;      ///< whose mesh it holds
  nlohmann::json mesh;  ///< whose part it is: samples and options

  Int3 extent() const;  ///< samples of the volume
};

/// What a piece of a surface begins with.
struct PieceDescription : PieceKey {
  MeshHeader of_mesh;  ///< of the whole mesh

  double isovalue() const;
};

/// What a piece is one of.
enum class PieceKind { surface, labels };

/// Before the header's text.
struct PieceStart {
  static constexpr std::uint64_t kMagic = 0x65636569706f7369;        // "isopiece"
  static constexpr std::uint64_t kLabelsMagic = 0x6c6562616c6f7369;  // "isolabel"
  static constexpr std::uint32_t kVersion = 1;
  /// Longer descriptions are none of ours; those of labels have names.
  static constexpr std::uint32_t kMaxHeader = std::uint32_t{64} << 20;
  std::uint64_t magic = kMagic;
  std::uint32_t version = kVersion;
  std::uint32_t header_bytes = 0;
};

/// Of a tile: before its positions, normals and triangles. Of tiles before the part, whose vertices
/// have the first numbers: alone.
struct PieceTile {
  std::uint64_t code = 0;  ///< morton_encode() of the tile
  std::uint32_t vertices = 0;
  std::uint32_t triangles = 0;
};

/// What a piece ends with. Of labels, `tiles` counts what tiles have of one label each, and
/// `neighbours` and `degenerate` are 0.
struct PieceEnd {
  static constexpr std::uint64_t kMagic = 0x646e656563656970;  // "pieceend"
  std::uint64_t neighbours = 0;  ///< tiles before the part that are listed
  std::uint64_t tiles = 0;       ///< of the part
  std::uint64_t vertices = 0;
  std::uint64_t triangles = 0;
  std::uint64_t degenerate = 0;    ///< triangles left out
  std::uint64_t largest_tile = 0;  ///< bytes of the largest tile's positions, normals, triangles
  std::uint64_t bytes = 0;         ///< of the whole file
  std::uint64_t magic = kMagic;
  std::uint32_t content_crc32c = 0;  ///< of all bytes before these
  std::uint32_t own_crc32c = 0;      ///< of these, but for itself
};

/// What one tile can have at most, whatever the options: three edges a sample, three vertices
/// within each cell and one on each sample; 16 triangles a cell and two at most on each border
/// face.
inline constexpr std::uint32_t kMaxTileVertices = 1 << 18;
inline constexpr std::uint32_t kMaxTileTriangles = 1 << 20;

/// Bytes of a tile behind its PieceTile.
std::uint64_t content_bytes(const PieceTile& tile, bool normals);

/// As members of a description, and back. Throws nlohmann::json::exception or Error for what is no
/// key.
nlohmann::json to_json(const PieceKey& key);
PieceKey piece_key_of(const nlohmann::json& object);

/// The text of a header: one for each header.
std::string to_text(const PieceDescription& header);
/// Nothing for a text that is none.
std::optional<PieceDescription> parse_description(std::string_view text);

/// Where the members of two `PieceDescription::mesh` differ: words for a message such as "isovalue
/// (1 and 2)"; empty where they are equal.
std::string difference(const nlohmann::json& mesh, const nlohmann::json& other);

/// "2 of 8".
std::string part_text(Part part);

}  // namespace isobrick
