#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>

#include "io/bytes/byte_stream.h"

namespace isobrick::inline v0 {

/// `count` streams of equal length one after the other, `open(i)` opens one: only
/// one of them is open at a time. `name` is for messages.
std::unique_ptr<ByteStream> make_concat_stream(
    std::string name, std::size_t count,
    std::function<std::unique_ptr<ByteStream>(std::size_t)> open);

}  // namespace isobrick
