#pragma once

#include <memory>

#include <isobrick/device_array.h>
#include <isobrick/extract.h>
#include "gpu/resident/cached_extractor.h"

namespace isobrick::inline v0 {

/// Samples of a store on a device, and what its surfaces need besides.
struct StoreOnDevice {
  std::unique_ptr<gpu::CachedExtractor> extractor;
  Box3 region;  ///< samples that were read
  Inside inside = Inside::above;
};

/// What of a region is read.
enum class LoadedPart : std::uint8_t {
  all,       ///< every sample
  isovalue,  ///< those that the surface of the isovalue looks at
};

/// Reads samples to a device, as DeviceExtractor says.
StoreOnDevice load_to_device(const StoreReader& store, const ExtractOptions& options,
                             const DeviceTarget& target, LoadedPart part, Progress& progress);

}  // namespace isobrick
