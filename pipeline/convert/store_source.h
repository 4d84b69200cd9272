#pragma once

#include <memory>
#include <string>

#include <isobrick/volume_request.h>
#include <isobrick/volume_source.h>

namespace isobrick {

/// The finest level of a store, or of another program's Zarr, as the input of a
/// conversion. Throws what StoreReader does, and UsageError for a request with
/// options of raw samples. `threads` will decode at once; 0: all cores.
std::unique_ptr<VolumeSource> open_store_source(const std::string& path,
                                                const VolumeRequest& request, int threads);

}  // namespace isobrick
