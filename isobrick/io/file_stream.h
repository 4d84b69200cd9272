#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "isobrick/io/byte_stream.h"
#include "isobrick/io/file.h"

namespace isobrick {

/// The bytes [begin, end) of a file; `path` is for messages.
std::unique_ptr<ByteStream> make_file_stream(InputFile file, std::string path, std::uint64_t begin,
                                             std::uint64_t end);

/// Standard input. A wait for bytes ends with Cancelled when an end is asked
/// for. Throws UsageError when it is a terminal.
std::unique_ptr<ByteStream> make_stdin_stream();

}  // namespace isobrick
