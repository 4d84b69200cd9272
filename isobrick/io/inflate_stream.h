#pragma once

#include <memory>

#include "isobrick/io/byte_stream.h"

namespace isobrick {

enum class Wrapper : unsigned char {
  gzip,  ///< one or more members; what follows them is passed over
  zlib,
};

/// What `packed` unpacks to, checksums compared. Throws DamageError where the
/// compressed bytes are damaged or end too early.
std::unique_ptr<ByteStream> make_inflate_stream(std::unique_ptr<ByteStream> packed,
                                                Wrapper wrapper);

}  // namespace isobrick
