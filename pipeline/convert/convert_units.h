#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <isobrick/part.h>
#include "bricks/store_layout.h"

namespace isobrick::inline v0 {

/// How level 0 of a store is divided among the parts of its conversion: into units, boxes of whole
/// shards, in C order. Follows from the layout alone.
class ConvertUnits {
 public:
  /// Throws UsageError where blocks of ranges would lie in several units.
  ConvertUnits(const StoreLayout& layout, const std::filesystem::path& out);

  std::uint64_t count() const { return static_cast<std::uint64_t>(volume(grid_)); }
  /// Samples of a unit.
  Box3 box(std::uint64_t unit) const;
  /// Of parts that have about as many samples each, the first unit, and behind the last part the
  /// number of units.
  std::vector<std::uint64_t> begins_of(std::uint32_t parts) const;

  /// Where all parts leave what they make.
  const std::filesystem::path& folder() const { return folder_; }
  /// Where a part leaves it: shards as those of a store, and a file for each unit.
  std::filesystem::path folder_of(Part part) const;
  std::filesystem::path file_of(Part part, std::uint64_t unit) const;
  /// By what files are recognised as of this layout.
  std::uint32_t layout_crc32c() const { return layout_crc32c_; }

 private:
  Lattice lattice_;
  Int3 edge_, grid_;
  std::filesystem::path folder_;
  std::uint32_t layout_crc32c_ = 0;
};

}  // namespace isobrick
