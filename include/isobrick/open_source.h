#pragma once

#include <memory>
#include <string>

#include <isobrick/api.h>
#include <isobrick/volume_request.h>
#include <isobrick/volume_source.h>

namespace isobrick::inline v0 {

/// Opens a volume: a file of a known format (recognised by its content before
/// its extension; docs/reference/formats.md lists them), a raw file, or standard input ("-").
/// Throws UsageError when file and request together make no volume: no
/// known extent or type, sizes that are zero, overflow or contradict the file's
/// size, a channel that must be chosen; Error when the file cannot be read.
ISOBRICK_API std::unique_ptr<VolumeSource> open_source(const std::string& path,
                                                       const VolumeRequest& request);

}  // namespace isobrick
