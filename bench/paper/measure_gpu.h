#pragma once

#include <nlohmann/json.hpp>

#include <isobrick/device_volume.h>
#include "bench/paper/measure.h"
#include "bench/paper/volumes.h"

namespace isobrick::bench {

/// The part of measure() that the current CUDA device does: isosurfaces by brute
/// force and through every structure, numbers of threads that share a tile,
/// searching and building. What it makes is compared with the CPU's before it is
/// timed: throws Error where it differs.
nlohmann::json measure_gpu(const LoadedVolume& v, const MeasureOptions& options);

}  // namespace isobrick::bench
