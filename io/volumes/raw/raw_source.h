#pragma once

#include <memory>

#include "io/bytes/file.h"
#include "io/volumes/sample_layout.h"

namespace isobrick::inline v0 {

/// Reads boxes of a file in any order, from any number of threads. The caller
/// has checked that the file is long enough.
std::unique_ptr<VolumeSource> make_raw_source(SampleLayout layout, File file);

/// Throws UsageError when the file ends before the last sample that its header describes.
void check_header_promise(const SampleLayout& layout, const File& file);

}  // namespace isobrick
