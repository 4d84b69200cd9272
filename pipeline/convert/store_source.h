#pragma once

#include <memory>
#include <string>

#include <isobrick/storage.h>
#include <isobrick/volume_request.h>
#include <isobrick/volume_source.h>

namespace isobrick::inline v0 {

/// The finest level of a store, or of another program's Zarr, as the input of a
/// conversion. Throws what StoreReader does, and UsageError for a request with
/// options of raw samples. `threads` will decode at once; 0: all cores. `remote` is of a URL.
std::unique_ptr<VolumeSource> open_store_source(const std::string& path,
                                                const VolumeRequest& request, int threads,
                                                const RemoteOptions& remote = {});

/// Any input of a conversion: Zarr as above, all else by open_source(). Throws what these do, and
/// UsageError for a grid of Zarr.
std::unique_ptr<VolumeSource> open_any_source(const std::string& path, const VolumeRequest& request,
                                              const RemoteOptions& remote = {});

}  // namespace isobrick
