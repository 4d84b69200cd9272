#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>

#include "bench/paper/volumes.h"

namespace isobrick::bench {

struct MeasureOptions {
  int runs = 7;
  int threads = 0;    ///< 0: all
  bool cells = true;  ///< also the structures over single cells
  bool peers = true;  ///< also VTK's trees
};

std::uint64_t count_triangles(const LoadedVolume& v);

/// Everything that the tables and plots need of one volume.
nlohmann::json measure(const LoadedVolume& v, const MeasureOptions& options);

}  // namespace isobrick::bench
