#pragma once

#include <memory>

#include "io/bytes/byte_stream.h"

namespace isobrick::inline v0 {

/// What base64 `text` stands for. Blanks and line ends are passed over; padding
/// may stand between pieces that were encoded one by one. The stream ends at a
/// '<' or with the text. Throws Error for other characters.
std::unique_ptr<ByteStream> make_base64_stream(std::unique_ptr<ByteStream> text);

/// `text` up to the first '<': the content of an XML element that holds no others.
std::unique_ptr<ByteStream> make_element_stream(std::unique_ptr<ByteStream> text);

}  // namespace isobrick
