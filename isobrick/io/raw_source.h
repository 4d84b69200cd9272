#pragma once

#include <cstdint>
#include <memory>

#include "isobrick/io/file.h"
#include "isobrick/io/volume_source.h"

namespace isobrick {

/// Samples one after the other in C order [z, y, x], somewhere in a file.
struct RawLayout {
  VolumeInfo info;           ///< `name` is the file's path
  std::uint64_t offset = 0;  ///< of the first sample, bytes
  bool swap = false;         ///< samples are of the other byte order
};

/// Reads boxes of a file in any order, from any number of threads. The caller
/// has checked that the file is long enough.
std::unique_ptr<VolumeSource> make_raw_source(RawLayout layout, InputFile file);

/// Reads planes from standard input, which must end with the last of them:
/// too few bytes and bytes left over are errors.
std::unique_ptr<VolumeSource> make_stdin_source(RawLayout layout);

}  // namespace isobrick
