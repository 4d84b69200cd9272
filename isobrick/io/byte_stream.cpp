#include "isobrick/io/byte_stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "isobrick/core/cancel.h"
#include "isobrick/core/error.h"

namespace isobrick {

void ByteStream::skip(std::uint64_t size) {
  std::array<std::byte, 65536> ignored;
  while (size > 0) {
    if (cancel_requested()) throw Cancelled("interrupted while reading " + name());
    const auto piece = static_cast<std::size_t>(std::min<std::uint64_t>(ignored.size(), size));
    read_exactly(ignored.data(), piece);
    size -= piece;
  }
}

void ByteStream::read_exactly(std::byte* out, std::size_t size) {
  if (const std::size_t got = read(out, size); got < size)
    throw Error(fmt::format("{} ends {} bytes too early", name(), size - got));
}

}  // namespace isobrick
