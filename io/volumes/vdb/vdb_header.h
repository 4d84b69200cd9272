#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace isobrick::inline v0 {

/// A grid of an OpenVDB file before any tree is read.
struct VdbGrid {
  std::string unique_name;           ///< as the file keeps it, with the number of a repeated name
  std::string name;                  ///< as users write it: "density", "density[1]"
  std::string own_name, unit;        ///< of its metadata: its name, and the unit of world space
  std::string type;                  ///< "Tree_float_5_4_3"
  bool half = false;                 ///< floats have 16 bits in the file
  std::string parent;                ///< unique name of the grid whose tree it shares, or empty
  std::uint64_t begin = 0, end = 0;  ///< bytes of the file that are the grid's
  std::uint64_t transform = 0;       ///< where its transform begins, behind its metadata
  std::string grid_class;            ///< "level set", "fog volume", …, or empty
  std::string map;                   ///< kind of its transform: "UniformScaleMap"

  /// "float", "vec3s", …
  std::string value_type() const;
};

/// The oldest and the newest version of files that are read here: OpenVDB 1.0's and 13's.
inline constexpr std::uint32_t kVdbOldest = 222, kVdbNewest = 225;

/// How an OpenVDB file is laid out.
struct VdbLayout {
  std::uint32_t version = 0;
  bool has_offsets = false;  ///< of its grids; streams have none

  /// Whether read_vdb_header() knows it. All else is left to OpenVDB's own reader.
  bool known() const { return version >= kVdbOldest && version <= kVdbNewest && has_offsets; }
};

/// Throws Error for what is no OpenVDB file.
VdbLayout read_vdb_layout(const std::string& path);

/// The grids of an OpenVDB file, in its order; none of a file whose layout is not known. Every
/// length and position is checked against the file's size. Throws Error for what is damaged.
std::vector<VdbGrid> read_vdb_header(const std::string& path);

/// Gives grids the names by which users know them, from their unique names.
void name_vdb_grids(std::vector<VdbGrid>& grids);

/// As much as is shown and kept of the texts by which a file describes a grid.
void describe_vdb_texts(VdbGrid& grid, const std::string& name, const std::string& unit,
                        const std::string& grid_class, const std::string& map);

/// Throws UsageError when a grid takes more bytes than `room`.
void check_vdb_memory(const std::string& path, const VdbGrid& grid, std::uint64_t needed,
                      const std::optional<std::uint64_t>& room);

/// Whether it is of a type and a shape that volumes are made of.
bool is_readable(const VdbGrid& grid);

/// The grid that is meant: by name, or the only one that is readable. Throws
/// UsageError that lists the grids otherwise.
const VdbGrid& choose_vdb_grid(const std::string& path, const std::vector<VdbGrid>& grids,
                               const std::optional<std::string>& name);

}  // namespace isobrick
