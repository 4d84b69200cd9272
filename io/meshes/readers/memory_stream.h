#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>

#include "io/bytes/byte_stream.h"

namespace isobrick::inline v0 {

/// Bytes in memory, which must live as long; `path` is for messages.
std::unique_ptr<ByteStream> make_memory_stream(const std::string& path,
                                               std::span<const std::byte> bytes);

}  // namespace isobrick
