#include "io/volumes/hdf5/hdf5_filters.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include <isobrick/error.h>
#include "io/bytes/inflate.h"
#include "io/volumes/hdf5/hdf5_lzf.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::size_t kChecksumBytes = 4;

/// Two runs of the same sums, as HDF5 folds them.
constexpr std::uint32_t fold(std::uint32_t sum) { return (sum & 0xffff) + (sum >> 16); }

/// Fletcher's checksum as HDF5 makes it: of big-endian 16-bit words, an odd last
/// byte counting as the upper half of one.
std::uint32_t fletcher32(const std::uint8_t* bytes, std::size_t size) {
  constexpr std::size_t kBatch = 360;  // words until a sum might overflow
  std::uint32_t first = 0, second = 0;
  for (std::size_t words = size / 2; words > 0;) {
    const std::size_t batch = std::min(words, kBatch);
    words -= batch;
    for (std::size_t i = 0; i < batch; ++i, bytes += 2) {
      first += static_cast<std::uint32_t>(bytes[0] << 8 | bytes[1]);
      second += first;
    }
    first = fold(first);
    second = fold(second);
  }
  if (size % 2 != 0) {
    first += static_cast<std::uint32_t>(*bytes << 8);
    second += first;
    first = fold(first);
    second = fold(second);
  }
  return fold(second) << 16 | fold(first);
}

void undo_fletcher32(PodBuffer<std::byte>& bytes) {
  if (bytes.size() < kChecksumBytes) throw DamageError("there is no room for its checksum");
  const std::size_t size = bytes.size() - kChecksumBytes;
  std::uint32_t stored;
  std::memcpy(&stored, bytes.data() + size, kChecksumBytes);
  const std::uint32_t sum = fletcher32(reinterpret_cast<const std::uint8_t*>(bytes.data()), size);
  // Little-endian machines once wrote it with the bytes of each half exchanged.
  const std::uint32_t old = (sum & 0x00ff00ff) << 8 | (sum >> 8 & 0x00ff00ff);
  if (stored != sum && stored != old) throw DamageError("the checksum is wrong");
  bytes.resize(size);
}

void undo_deflate(Hdf5ChunkBuffers& buffers, std::size_t size) {
  buffers.other.resize(size);
  const InflateResult done = inflate(Wrapper::zlib, {buffers.bytes.data(), buffers.bytes.size()},
                                     {buffers.other.data(), size});
  if (!done.filled(size))
    throw DamageError(fmt::format("it does not unpack to {} bytes (code {})", size, done.code));
  std::swap(buffers.bytes, buffers.other);
}

void undo_lzf(Hdf5ChunkBuffers& buffers, std::size_t size) {
  unpack_lzf({buffers.bytes.data(), buffers.bytes.size()}, size, buffers.other);
  std::swap(buffers.bytes, buffers.other);
}

/// Byte b of all elements follows byte b - 1 of all; what is left over is as it was.
template <std::size_t kElement>
void unshuffle(const std::byte* from, std::size_t count, std::byte* to) {
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t b = 0; b < kElement; ++b) to[i * kElement + b] = from[b * count + i];
}

void undo_shuffle(Hdf5ChunkBuffers& buffers, std::size_t element) {
  if (element == 1) return;
  const std::size_t size = buffers.bytes.size(), count = size / element;
  buffers.other.resize(size);
  const std::byte* from = buffers.bytes.data();
  std::byte* to = buffers.other.data();
  switch (element) {
    case 2: unshuffle<2>(from, count, to); break;
    case 4: unshuffle<4>(from, count, to); break;
    case 8: unshuffle<8>(from, count, to); break;
    default:
      for (std::size_t i = 0; i < count; ++i)
        for (std::size_t b = 0; b < element; ++b) to[i * element + b] = from[b * count + i];
  }
  std::copy(from + count * element, from + size, to + count * element);
  std::swap(buffers.bytes, buffers.other);
}

/// Bytes that a chunk had before filter `at` was applied, which compresses.
std::size_t size_before(const Hdf5Encoding& encoding, std::uint32_t skipped, std::size_t at) {
  std::size_t size = encoding.chunk_bytes;
  for (std::size_t i = 0; i < at; ++i)
    if (encoding.filters[i] == Hdf5Filter::fletcher32 && (skipped >> i & 1) == 0)
      size += kChecksumBytes;
  return size;
}

}  // namespace

std::size_t Hdf5Encoding::max_packed() const {
  return max_deflated(chunk_bytes) + filters.size() * kChecksumBytes;
}

void undo_filters(const Hdf5Encoding& encoding, std::uint32_t skipped, Hdf5ChunkBuffers& buffers) {
  for (std::size_t i = encoding.filters.size(); i-- > 0;) {
    if ((skipped >> i & 1) != 0) continue;
    switch (encoding.filters[i]) {
      case Hdf5Filter::deflate: undo_deflate(buffers, size_before(encoding, skipped, i)); break;
      case Hdf5Filter::lzf: undo_lzf(buffers, size_before(encoding, skipped, i)); break;
      case Hdf5Filter::shuffle: undo_shuffle(buffers, encoding.element); break;
      case Hdf5Filter::fletcher32: undo_fletcher32(buffers.bytes); break;
    }
  }
  if (buffers.bytes.size() != encoding.chunk_bytes)
    throw DamageError(fmt::format("it has {} bytes of samples, not {}", buffers.bytes.size(),
                                  encoding.chunk_bytes));
}

}  // namespace isobrick
