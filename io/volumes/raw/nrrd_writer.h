#pragma once

#include <string>

#include <isobrick/volume_source.h>

namespace isobrick::inline v0 {

/// The header of a NRRD file, up to and with the empty line that the samples
/// follow: raw, little endian, x fastest. Numbers are the shortest decimals that
/// read back as the same double. With `data_file` the header stands alone and the samples are all
/// of that file, named relative to the header.
std::string nrrd_header_text(const VolumeInfo& info, const std::string& data_file = {});

}  // namespace isobrick
