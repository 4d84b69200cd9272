#pragma once

#include <cstdint>
#include <memory>

#include "io/bytes/byte_stream.h"
#include "io/bytes/file.h"

namespace isobrick::inline v0 {

/// The bytes of a file from `begin` to its end.
std::unique_ptr<ByteStream> make_file_stream(File file, std::uint64_t begin = 0);

/// Standard input. A wait for bytes ends with Cancelled when the user ends the
/// program. Throws UsageError when it is a terminal.
std::unique_ptr<ByteStream> make_stdin_stream();

}  // namespace isobrick
