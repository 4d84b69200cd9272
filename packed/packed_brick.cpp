#include "packed/packed_brick.h"

#include <algorithm>
#include <cstring>
#include <optional>
#include <utility>

#include <isobrick/error.h>
#include <isobrick/pod_buffer.h>
#include "core/copy_box.h"
#include "packed/packed_blocks.h"
#include "packed/packed_layout.h"
#include "packed/palette.h"

namespace isobrick::inline v0 {
namespace {

using packed::kBlock;
using packed::kEdge;

/// Blocks hold at most so many times the samples of a brick.
constexpr Index kMostRepeated = 4;

/// Calls f(number, first sample) of each block of a brick, x fastest.
template <class F>
void for_each_block(Int3 extent, const F& f) {
  const Int3 blocks = packed::blocks_of(extent);
  std::size_t number = 0;
  for (Index z = 0; z < blocks.z; ++z)
    for (Index y = 0; y < blocks.y; ++y)
      for (Index x = 0; x < blocks.x; ++x) f(number++, Int3{x, y, z} * Index{kEdge});
}

/// Copies a row of a block. Whole rows are of few sizes, which no call is made for.
void copy_row(std::byte* to, const std::byte* from, std::size_t size) {
  switch (size) {
    case 16: std::memcpy(to, from, 16); break;
    case 32: std::memcpy(to, from, 32); break;
    case 64: std::memcpy(to, from, 64); break;
    default: std::memcpy(to, from, size);
  }
}

/// A block of samples; where it reaches beyond the brick the last ones are repeated.
void gather(Int3 extent, const std::byte* samples, std::size_t bytes, Int3 first, std::byte* to) {
  const auto inside = static_cast<std::size_t>(std::min<Index>(kEdge, extent.x - first.x));
  for (Index z = 0; z < kEdge; ++z)
    for (Index y = 0; y < kEdge; ++y, to += kEdge * bytes) {
      const Int3 row{first.x, std::min(first.y + y, extent.y - 1),
                     std::min(first.z + z, extent.z - 1)};
      const std::byte* const from =
          samples + static_cast<std::size_t>(linear_index(row, extent)) * bytes;
      copy_row(to, from, inside * bytes);
      for (std::size_t x = inside; x < kEdge; ++x)
        std::memcpy(to + x * bytes, from + (inside - 1) * bytes, bytes);
    }
}

/// Nothing where that would not be shorter than `most` bytes.
std::optional<std::vector<std::byte>> pack_as(packed::BlockKind kind, Int3 extent,
                                              const std::byte* samples,
                                              const packed::Palette* palette, std::size_t most) {
  std::vector<std::byte> result(packed::table_bytes(extent));
  const packed::BrickHeader header{
      .code_bytes = static_cast<std::uint8_t>(kind.code_bytes),
      .palette = static_cast<std::uint16_t>(palette ? palette->entries : 0)};
  std::memcpy(result.data(), &header, sizeof header);
  if (palette) result.insert(result.end(), palette->values.begin(), palette->values.end());
  const std::size_t first = result.size();
  alignas(64) std::byte block[kBlock * sizeof(std::uint64_t)];
  std::byte bytes[packed::max_block_bytes(sizeof(std::uint64_t))];
  for_each_block(extent, [&](std::size_t number, Int3 place) {
    if (result.size() >= most) return;
    gather(extent, samples, kind.code_bytes, place, block);
    const std::size_t size =
        packed::pack_block(kind, block, reinterpret_cast<std::uint8_t*>(bytes));
    result.insert(result.end(), bytes, bytes + size);
    const auto end = static_cast<std::uint32_t>(result.size() - first);
    std::memcpy(result.data() + sizeof(packed::BrickHeader) + number * sizeof end, &end,
                sizeof end);
  });
  if (result.size() >= most) return std::nullopt;
  result.shrink_to_fit();
  return result;
}

std::vector<std::byte> pack_plain(std::span<const std::byte> samples) {
  const packed::BrickHeader header;
  std::vector<std::byte> result(sizeof header + samples.size());
  std::memcpy(result.data(), &header, sizeof header);
  std::copy(samples.begin(), samples.end(), result.begin() + sizeof header);
  return result;
}

/// Unpacks the blocks of a brick; those that reach beyond it by way of a block of their own.
void unpack_blocks(const packed::BrickLayout& layout, packed::BlockKind kind, Int3 extent,
                   std::byte* samples) {
  const std::size_t bytes = kind.code_bytes;
  alignas(64) std::byte block[kBlock * sizeof(std::uint64_t)];
  for_each_block(extent, [&](std::size_t number, Int3 first) {
    const Box3 full{first, first + Int3{kEdge, kEdge, kEdge}};
    const BoxSamples<std::byte> to{samples, {{}, extent}};
    const bool whole = full.hi.x <= extent.x && full.hi.y <= extent.y && full.hi.z <= extent.z;
    const bool good =
        whole ? packed::unpack_block(kind, layout.block(number), to.at(first, bytes), extent.x,
                                     extent.x * extent.y)
              : packed::unpack_block(kind, layout.block(number), block, kEdge, kEdge * kEdge);
    if (!good) throw DamageError(packed::damaged_block(number));
    if (!whole) copy_box({block, full}, to, intersect(full, to.box), bytes);
  });
}

}  // namespace

std::vector<std::byte> pack_brick(ScalarType type, Int3 extent,
                                  std::span<const std::byte> samples) {
  const std::size_t most = packed::max_packed_bytes(extent, size_of(type));
  // Blocks of thin bricks would hold little but repeated samples.
  if (volume(packed::blocks_of(extent)) * kBlock > kMostRepeated * volume(extent))
    return pack_plain(samples);
  const auto palette = packed::find_palette(type, samples);
  const packed::BlockKind kind =
      palette ? packed::BlockKind{} : packed::BlockKind{size_of(type), is_floating(type)};
  auto packed = pack_as(kind, extent, palette ? palette->numbers.data() : samples.data(),
                        palette ? &*palette : nullptr, most);
  return packed ? *std::move(packed) : pack_plain(samples);
}

std::size_t packed_brick_memory(std::size_t brick_bytes) {
  // What pack_brick() writes to, which grows, and the numbers of a palette.
  return 3 * brick_bytes + packed::max_block_bytes(sizeof(std::uint64_t));
}

void unpack_brick(ScalarType type, Int3 extent, std::span<const std::byte> packed,
                  std::span<std::byte> samples) {
  const packed::BrickLayout layout(type, extent, packed);
  if (layout.is_plain()) {
    std::copy(layout.plain().begin(), layout.plain().end(), samples.begin());
    return;
  }
  if (layout.entries() == 0)
    return unpack_blocks(layout, {size_of(type), is_floating(type)}, extent, samples.data());
  thread_local PodBuffer<std::byte> numbers;
  numbers.resize(static_cast<std::size_t>(volume(extent)));
  unpack_blocks(layout, {1, false}, extent, numbers.data());
  packed::look_up(layout.palette(), layout.entries(), {numbers.data(), numbers.size()},
                  samples.data());
}

}  // namespace isobrick
