#pragma once

#include <memory>

#include "isobrick/io/file.h"
#include "isobrick/volumes/sample_layout.h"

namespace isobrick {

/// Reads boxes of a file in any order, from any number of threads. The caller
/// has checked that the file is long enough.
std::unique_ptr<VolumeSource> make_raw_source(SampleLayout layout, InputFile file);

}  // namespace isobrick
