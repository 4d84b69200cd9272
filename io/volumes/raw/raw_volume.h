#pragma once

#include <memory>
#include <string>

#include <isobrick/volume_request.h>
#include "io/volumes/raw/text_header.h"

namespace isobrick::inline v0 {

/// Opens a file of raw samples, described by the caller, by a header that lies
/// beside it (`x.nhdr`, `x.mhd`) or by its name.
std::unique_ptr<VolumeSource> open_raw(const std::string& path, const VolumeRequest& request);

/// Standard input, which must end with the last sample.
std::unique_ptr<VolumeSource> open_stdin(const VolumeRequest& request);

/// Opens the samples that a text header describes. Throws UsageError when their
/// number differs from the header's.
std::unique_ptr<VolumeSource> open_text_volume(const TextHeader& header,
                                               const VolumeRequest& request);

/// The header of a NRRD or a MetaImage.
TextHeader parse_text_header(const std::string& path, bool nrrd, const Selection& selection);

}  // namespace isobrick
