#include "bricks/zarr/codec.h"

#include <fmt/format.h>
#include <isa-l/crc.h>
// For the estimate of a context's size, which is not in the stable part.
#define ZSTD_STATIC_LINKING_ONLY
#include <zstd.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>

#include <isobrick/error.h>
#include <isobrick/pod_buffer.h>
#include "io/bytes/byte_order.h"
#include "packed/packed_brick.h"

namespace isobrick::inline v0 {
namespace {

static_assert(std::endian::native == std::endian::little, "samples are copied as they are");

constexpr std::size_t kCrcBytes = 4;

struct ContextDeleter {
  void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
};

// A context costs a megabyte and its creation more than a small brick, so each
// thread keeps one.
ZSTD_CCtx* compression_context() {
  thread_local const std::unique_ptr<ZSTD_CCtx, ContextDeleter> context(ZSTD_createCCtx());
  if (!context) throw std::bad_alloc();
  return context.get();
}

void append_crc(std::vector<std::byte>& bytes) {
  const std::uint32_t crc = crc32c(bytes);
  const std::size_t size = bytes.size();
  bytes.resize(size + kCrcBytes);
  std::memcpy(bytes.data() + size, &crc, kCrcBytes);
}

// Compresses into a buffer of the thread first: what is handed out is then
// exactly as large as what it holds, and the bound is not allocated each time.
std::vector<std::byte> compress(std::span<const std::byte> bytes, const CodecChain& chain,
                                std::size_t reserve) {
  thread_local PodBuffer<std::byte> buffer;
  buffer.resize(ZSTD_compressBound(bytes.size()));
  ZSTD_CCtx* const context = compression_context();
  ZSTD_CCtx_setParameter(context, ZSTD_c_compressionLevel, chain.zstd_level);
  ZSTD_CCtx_setParameter(context, ZSTD_c_checksumFlag, chain.zstd_checksum ? 1 : 0);
  const std::size_t size =
      ZSTD_compress2(context, buffer.data(), buffer.size(), bytes.data(), bytes.size());
  if (ZSTD_isError(size))
    throw Error(fmt::format("zstd cannot compress: {}", ZSTD_getErrorName(size)));
  std::vector<std::byte> result;
  result.reserve(size + reserve);
  result.insert(result.end(), buffer.data(), buffer.data() + size);
  return result;
}

}  // namespace

CodecChain CodecChain::ours(std::optional<int> zstd_level) {
  CodecChain chain;
  if (zstd_level) {
    chain.steps.push_back(ByteCodec::zstd);
    chain.zstd_level = *zstd_level;
  }
  chain.steps.push_back(ByteCodec::crc32c);
  return chain;
}

CodecChain CodecChain::ours_v2(std::optional<int> zstd_level) {
  CodecChain chain;
  if (!zstd_level) return chain;
  chain.steps.push_back(ByteCodec::zstd);
  chain.zstd_level = *zstd_level;
  chain.zstd_checksum = true;
  return chain;
}

CodecChain CodecChain::of(BrickCodec codec, int zstd_level, bool zarr_v2) {
  const auto level = codec == BrickCodec::zstd ? std::optional(zstd_level) : std::nullopt;
  CodecChain chain = zarr_v2 ? ours_v2(level) : ours(level);
  chain.packed = codec == BrickCodec::packed;
  return chain;
}

std::string CodecChain::name() const {
  if (packed) return "packed";
  for (const ByteCodec step : steps) {
    if (step == ByteCodec::zstd) return fmt::format("zstd:{}", zstd_level);
    if (step != ByteCodec::crc32c) return std::string(name_of(step));
  }
  return "none";
}

std::uint32_t crc32c(std::span<const std::byte> bytes, std::uint32_t before) {
  // ISA-L takes the length as an int and neither inverts its argument nor its result.
  constexpr std::size_t kStep = std::size_t{1} << 30;
  std::uint32_t state = ~before;
  for (std::size_t done = 0; done < bytes.size(); done += kStep) {
    const auto part = bytes.subspan(done, std::min(kStep, bytes.size() - done));
    auto* data = const_cast<unsigned char*>(reinterpret_cast<const unsigned char*>(part.data()));
    state = crc32_iscsi(data, static_cast<int>(part.size()), state);
  }
  return ~state;
}

std::span<const std::byte> without_checksum(std::span<const std::byte> encoded) {
  if (encoded.size() < kCrcBytes) throw DamageError("too short for a checksum");
  const auto body = encoded.first(encoded.size() - kCrcBytes);
  std::uint32_t stored;
  std::memcpy(&stored, encoded.data() + body.size(), kCrcBytes);
  if (const std::uint32_t crc = crc32c(body); crc != stored)
    throw DamageError(fmt::format("checksum is {:08x}, must be {:08x}", crc, stored));
  return body;
}

std::uint64_t fill_bits(ScalarType type, const SampleValue& fill_value) {
  // Not a value of the type: metadata is checked before, so this is a caller's slip.
  if (!is_sample(fill_value, type))
    throw Error(fmt::format("fill value {} is no {}", fill_value.text(), zarr_name(type)));
  return visit_sample(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    T value = fill_value.as<T>();
    if constexpr (std::is_floating_point_v<T>)
      if (std::isnan(value)) value = std::numeric_limits<T>::quiet_NaN();
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof value);
    return bits;
  });
}

bool all_fill(ScalarType type, std::span<const std::byte> samples, const SampleValue& fill_value) {
  const std::size_t size = size_of(type);
  if (samples.size() < size) return samples.empty();
  const std::uint64_t bits = fill_bits(type, fill_value);
  // The first sample is the fill value and each equals the one before it: one
  // memcmp of the brick with itself, which mostly ends at once.
  return std::memcmp(samples.data(), &bits, size) == 0 &&
         std::memcmp(samples.data(), samples.data() + size, samples.size() - size) == 0;
}

void fill_box(ScalarType type, const SampleValue& fill_value, BoxSamples<std::byte> samples,
              Box3 part) {
  set_box(type, fill_bits(type, fill_value), samples, part);
}

void set_box(ScalarType type, std::uint64_t bits, BoxSamples<std::byte> samples, Box3 part) {
  visit_sample(type, [&](auto tag) {
    using T = typename decltype(tag)::type;
    T value;
    std::memcpy(&value, &bits, sizeof value);
    for (Index z = part.lo.z; z < part.hi.z; ++z)
      for (Index y = part.lo.y; y < part.hi.y; ++y)
        std::fill_n(reinterpret_cast<T*>(samples.at({part.lo.x, y, z}, sizeof(T))),
                    part.hi.x - part.lo.x, value);
  });
}

void pad_brick(const Lattice& lattice, Int3 b, const SampleValue& fill_value, std::byte* brick) {
  const Box3 full = lattice.full_brick_box(b), held = lattice.brick_box(b);
  for (int axis = 0; axis < 3; ++axis) {
    Box3 beyond = full;
    beyond.lo[axis] = held.hi[axis];
    if (!beyond.empty()) fill_box(lattice.type, fill_value, {brick, full}, beyond);
  }
}

std::size_t encoder_memory(const CodecChain& chain, std::size_t brick_bytes) {
  if (chain.packed) return packed_brick_memory(brick_bytes);
  if (chain.steps.empty() || chain.steps.front() != ByteCodec::zstd) return 0;
  return ZSTD_estimateCCtxSize_usingCParams(ZSTD_getCParams(chain.zstd_level, brick_bytes, 0));
}

std::vector<std::byte> encode_bytes(const CodecChain& chain, std::span<const std::byte> bytes) {
  std::vector<std::byte> result;
  bool first = true;
  for (const ByteCodec step : chain.steps) {
    if (step == ByteCodec::zstd)
      result = compress(first ? bytes : std::span<const std::byte>(result), chain, kCrcBytes);
    else if (step != ByteCodec::crc32c) {
      throw Error(fmt::format("{} is only read, not written", name_of(step)));
    } else {
      if (first) {
        result.reserve(bytes.size() + kCrcBytes);
        result.assign(bytes.begin(), bytes.end());
      }
      append_crc(result);
    }
    first = false;
  }
  if (first) result.assign(bytes.begin(), bytes.end());
  return result;
}

std::optional<std::vector<std::byte>> encode_brick(const Lattice& lattice,
                                                   std::span<const std::byte> samples,
                                                   const SampleValue& fill_value,
                                                   const CodecChain& chain) {
  if (all_fill(lattice.type, samples, fill_value)) return std::nullopt;
  if (!chain.packed) return encode_bytes(chain, samples);
  std::vector<std::byte> packed = pack_brick(lattice.type, lattice.brick, samples);
  append_crc(packed);
  return packed;
}

std::uint64_t decoded_size(const CodecChain& chain, std::span<const std::byte> encoded) {
  if (encoded.size() < kCrcBytes) throw DamageError("too short for a checksum");
  if (chain.steps.front() == ByteCodec::crc32c) return encoded.size() - kCrcBytes;
  const unsigned long long size =
      ZSTD_getFrameContentSize(encoded.data(), encoded.size() - kCrcBytes);
  if (size == ZSTD_CONTENTSIZE_UNKNOWN || size == ZSTD_CONTENTSIZE_ERROR)
    throw DamageError("is no zstd frame that states its size");
  return size;
}

void decode_brick(const CodecChain& chain, const Lattice& lattice, std::size_t sample_bytes,
                  std::span<const std::byte> encoded, std::span<std::byte> out) {
  if (!chain.packed) return decode_bytes(chain, sample_bytes, encoded, out);
  unpack_brick(lattice.type, lattice.brick, without_checksum(encoded), out);
}

void decode_bytes(const CodecChain& chain, std::size_t sample_bytes,
                  std::span<const std::byte> encoded, std::span<std::byte> out) {
  // Two buffers for the rare chain that compresses more than once.
  std::vector<std::byte> storage, next;
  std::span<const std::byte> current = encoded;
  bool in_place = false;
  for (std::size_t i = chain.steps.size(); i-- > 0;) {
    if (chain.steps[i] == ByteCodec::crc32c) {
      current = without_checksum(current);
      continue;
    }
    if (i == 0) {
      // The fast path: straight to where the samples are wanted.
      const std::size_t size = decompress(chain.steps[i], current, out);
      if (size != out.size())
        throw DamageError(fmt::format("decodes to {} bytes, must be {}", size, out.size()));
      in_place = true;
    } else {
      // What an inner step leaves is at most the samples and a few checksums or frames.
      next.resize(ZSTD_compressBound(out.size()) + kCrcBytes * chain.steps.size());
      next.resize(decompress(chain.steps[i], current, next));
      storage.swap(next);
      current = storage;
    }
  }
  if (!in_place) {
    if (current.size() != out.size())
      throw DamageError(fmt::format("decodes to {} bytes, must be {}", current.size(), out.size()));
    std::copy(current.begin(), current.end(), out.begin());
  }
  if (chain.big_endian) swap_byte_order(out.data(), out.size() / sample_bytes, sample_bytes);
}

}  // namespace isobrick
