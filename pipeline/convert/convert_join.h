#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include <isobrick/volume_source.h>
#include "bricks/store_writer.h"
#include "pipeline/convert/convert_units.h"
#include "pipeline/index/value_counts.h"

namespace isobrick::inline v0 {

/// All parts of a conversion, to be made a store of.
class JoinedParts {
 public:
  /// Throws UsageError naming the parts that are not there or not whole. Reads all of their units.
  JoinedParts(const StoreLayout& layout, const std::filesystem::path& out, std::uint32_t parts);
  ~JoinedParts();

  struct Counts {
    std::uint64_t bricks = 0, absent = 0;
    bool has_nan = false;
  };
  /// Moves the shards of level 0 into a store, and gives it and `values` what else is known of that
  /// level.
  Counts add_to(StoreWriter& store, ValueCounts& values) const;
  /// The samples of level 1, where there is one.
  VolumeSource& coarser() const;
  /// The store has its name: what the parts made goes.
  void remove() const;

 private:
  class Coarser;
  Part part_of(std::uint64_t unit) const;

  const StoreLayout& layout_;
  ConvertUnits units_;
  std::uint32_t parts_;
  std::vector<std::uint64_t> begins_;  ///< the first unit of each part
  std::unique_ptr<Coarser> coarser_;
};

}  // namespace isobrick
