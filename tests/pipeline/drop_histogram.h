#pragma once

#include <filesystem>
#include <fstream>

#include "bricks/ranges/stored_ranges.h"

namespace isobrick::test {

/// Makes a store one that keeps no histogram.
inline void drop_histogram(const std::filesystem::path& store) {
  StoredRanges ranges = *read_stored_ranges(*folder_storage(store), "");
  ranges.histogram.reset();
  std::ofstream(store / ranges_file("")) << to_json(ranges);
  std::filesystem::remove_all(store / histogram_folder(""));
}

}  // namespace isobrick::test
