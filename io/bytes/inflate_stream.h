#pragma once

#include <memory>

#include "io/bytes/byte_stream.h"
#include "io/bytes/inflate.h"

namespace isobrick::inline v0 {

/// What `packed` unpacks to, checksums compared. Throws DamageError where the
/// compressed bytes are damaged or end too early.
std::unique_ptr<ByteStream> make_inflate_stream(std::unique_ptr<ByteStream> packed,
                                                Wrapper wrapper);

}  // namespace isobrick
