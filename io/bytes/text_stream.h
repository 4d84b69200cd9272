#pragma once

#include <memory>

#include <isobrick/scalar.h>
#include "io/bytes/byte_stream.h"

namespace isobrick::inline v0 {

/// Samples of `type`, as they would be stored in native byte order, from numbers in a text that
/// blanks, commas or line ends separate. Throws Error, with the position, for words that are no
/// number of the type. Whole numbers may be written with a fraction of zeros; floating ones
/// beyond the type's range are infinite or zero. Of types that are widened it takes 64-bit
/// integers.
std::unique_ptr<ByteStream> make_text_stream(std::unique_ptr<ByteStream> text, ScalarType type);

}  // namespace isobrick
