#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "isobrick/io/byte_stream.h"
#include "isobrick/io/sample_layout.h"

namespace isobrick {

/// Reads planes from a stream. `end` is where the stream must end, if that is
/// known and matters: bytes left over are an error then, found when the last
/// plane is read. Throws UsageError when the stream cannot have enough bytes.
std::unique_ptr<VolumeSource> make_stream_source(SampleLayout layout,
                                                 std::unique_ptr<ByteStream> stream,
                                                 std::optional<std::uint64_t> end);

}  // namespace isobrick
