#include "io/bytes/byte_stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>

#include <isobrick/error.h>
#include "core/cancel.h"
#include "io/bytes/byte_order.h"

namespace isobrick::inline v0 {

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

std::uint64_t ByteStream::read_unsigned(std::size_t bytes, bool swap) {
  std::byte raw[sizeof(std::uint64_t)]{};
  read_exactly(raw, bytes);
  if (swap) swap_byte_order(raw, 1, bytes);
  std::uint64_t value = 0;
  std::memcpy(&value, raw, bytes);
  return value;
}

}  // namespace isobrick
