#include "bricks/zarr/decompress.h"

#include <fmt/format.h>
#include <zstd.h>
#ifdef ISOBRICK_WITH_BLOSC
#include <blosc.h>
#endif
#ifdef ISOBRICK_WITH_LZ4
#include <lz4.h>
#endif

#include <array>
#include <cstring>
#include <limits>
#include <memory>

#include <isobrick/error.h>
#include "io/bytes/inflate.h"

namespace isobrick::inline v0 {
namespace {

constexpr std::array<std::string_view, 6> kNames{"zstd", "crc32c", "gzip", "zlib", "lz4", "blosc"};

struct ContextDeleter {
  void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
};

std::size_t decompress_zstd(std::span<const std::byte> encoded, std::span<std::byte> out) {
  // A context costs a megabyte, so each thread keeps one.
  thread_local const std::unique_ptr<ZSTD_DCtx, ContextDeleter> context(ZSTD_createDCtx());
  if (!context) throw std::bad_alloc();
  const std::size_t size =
      ZSTD_decompressDCtx(context.get(), out.data(), out.size(), encoded.data(), encoded.size());
  if (ZSTD_isError(size))
    throw DamageError(fmt::format("zstd cannot decompress: {}", ZSTD_getErrorName(size)));
  return size;
}

std::size_t decompress_deflate(Wrapper wrapper, std::span<const std::byte> encoded,
                               std::span<std::byte> out) {
  const InflateResult done = inflate(wrapper, encoded, out);
  switch (done.status) {
    case InflateResult::Status::complete: return done.size;
    case InflateResult::Status::no_room:
      throw DamageError("the deflate stream is longer than its samples");
    case InflateResult::Status::cut_off: throw DamageError("the deflate stream is cut off");
    case InflateResult::Status::invalid: break;
  }
  throw DamageError(fmt::format("no valid deflate stream (code {})", done.code));
}

std::size_t decompress_lz4([[maybe_unused]] std::span<const std::byte> encoded,
                           [[maybe_unused]] std::span<std::byte> out) {
#ifdef ISOBRICK_WITH_LZ4
  // The length comes first, as numcodecs writes it.
  std::uint32_t length = 0;
  if (encoded.size() < sizeof(length)) throw DamageError("too short for LZ4");
  std::memcpy(&length, encoded.data(), sizeof(length));
  const auto block = encoded.subspan(sizeof(length));
  if (length > out.size())
    throw DamageError(fmt::format("LZ4 states {} bytes, must be {}", length, out.size()));
  const int size = LZ4_decompress_safe(reinterpret_cast<const char*>(block.data()),
                                       reinterpret_cast<char*>(out.data()),
                                       static_cast<int>(block.size()), static_cast<int>(length));
  if (size < 0 || static_cast<std::uint32_t>(size) != length)
    throw DamageError("no valid LZ4 block");
  return length;
#else
  throw Error("this program was built without lz4, which compressed the samples");
#endif
}

std::size_t decompress_blosc([[maybe_unused]] std::span<const std::byte> encoded,
                             [[maybe_unused]] std::span<std::byte> out) {
#ifdef ISOBRICK_WITH_BLOSC
  std::size_t size = 0;
  if (encoded.size() < BLOSC_MIN_HEADER_LENGTH ||
      blosc_cbuffer_validate(encoded.data(), encoded.size(), &size) != 0)
    throw DamageError("no valid Blosc header");
  if (size > out.size())
    throw DamageError(fmt::format("Blosc states {} bytes, must be {}", size, out.size()));
  const int got = blosc_decompress_ctx(encoded.data(), out.data(), out.size(), 1);
  if (got < 0 || static_cast<std::size_t>(got) != size)
    throw DamageError(fmt::format("Blosc cannot decompress (code {})", got));
  return size;
#else
  throw Error("this program was built without libblosc, which compressed the samples");
#endif
}

}  // namespace

std::string_view name_of(ByteCodec codec) { return kNames[static_cast<std::size_t>(codec)]; }

bool can_decompress(ByteCodec codec) {
#ifndef ISOBRICK_WITH_BLOSC
  if (codec == ByteCodec::blosc) return false;
#endif
#ifndef ISOBRICK_WITH_LZ4
  if (codec == ByteCodec::lz4) return false;
#endif
  return codec != ByteCodec::crc32c;
}

std::size_t decompress(ByteCodec codec, std::span<const std::byte> encoded,
                       std::span<std::byte> out) {
  // The libraries count in ints.
  if (encoded.size() > std::numeric_limits<std::int32_t>::max())
    throw DamageError(fmt::format("{} compressed bytes are too many", encoded.size()));
  switch (codec) {
    case ByteCodec::zstd: return decompress_zstd(encoded, out);
    case ByteCodec::gzip: return decompress_deflate(Wrapper::gzip, encoded, out);
    case ByteCodec::zlib: return decompress_deflate(Wrapper::zlib, encoded, out);
    case ByteCodec::lz4: return decompress_lz4(encoded, out);
    case ByteCodec::blosc: return decompress_blosc(encoded, out);
    case ByteCodec::crc32c: break;
  }
  throw Error("a checksum compresses nothing");
}

}  // namespace isobrick
