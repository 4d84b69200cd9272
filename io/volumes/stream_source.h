#pragma once

#include <cstdint>
#include <memory>

#include "io/bytes/byte_stream.h"
#include "io/volumes/sample_layout.h"

namespace isobrick::inline v0 {

/// What becomes of bytes that follow the samples.
enum class AfterEnd : unsigned char {
  refused,
  noted,             ///< ignored, and counted in a note
  noted_as_numbers,  ///< the same of a text: its numbers are counted
  unread,
};

/// Reads planes from a stream. `end` is where its samples end, also those that
/// are not of this volume; where that is near the last one read, checksums at the
/// end of the stream are compared and bytes left over are found. Throws
/// UsageError when the stream cannot have enough bytes.
std::unique_ptr<VolumeSource> make_stream_source(SampleLayout layout,
                                                 std::unique_ptr<ByteStream> stream,
                                                 std::uint64_t end,
                                                 AfterEnd after_end = AfterEnd::refused);

}  // namespace isobrick
