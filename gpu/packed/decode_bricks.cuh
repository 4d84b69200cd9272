#pragma once

#include <type_traits>

#include "gpu/packed/decode_lanes.cuh"
#include "gpu/packed/decode_params.h"
#include "gpu/packed/prefetch.cuh"
#include "packed/packed_format.h"

// The kernel that decodes packed bricks; docs/reference/packed_codec.md has their bytes.
//
// A warp decodes four blocks of 16³ samples. First all of its threads look for the groups of each
// block, a thread a group: how long a sparse plane is stands in the block itself, so that where a
// group begins is a sum over all before it. Then eight threads decode each block, slice by slice:
// a thread has four columns of eight rows, so the planes of a group become rows without any other
// thread. Only sums along x go across threads, and from the first eight rows to the next.

namespace isobrick::inline v0::gpu {

inline constexpr int kBlocksOfWarp = 4, kDecodeWarps = kBlocksOfPart / kBlocksOfWarp;
inline constexpr std::uint32_t kAllLanes = ~0u;

/// Unsigned integers of so many bytes.
template <int kBytes>
using Unsigned = std::conditional_t<
    kBytes == 1, std::uint8_t,
    std::conditional_t<kBytes == 2, std::uint16_t,
                       std::conditional_t<kBytes == 4, std::uint32_t, unsigned long long>>>;

/// The four bytes from an address on, whatever its alignment; reads up to 7 bytes beyond them.
__device__ inline std::uint32_t load_word(const std::uint8_t* from) {
  const auto address = reinterpret_cast<std::size_t>(from);
  const auto* const words = reinterpret_cast<const std::uint32_t*>(address & ~std::size_t{3});
  return __funnelshift_r(__ldg(words), __ldg(words + 1),
                         static_cast<std::uint32_t>(address & 3) * 8);
}

template <int kBytes>
__device__ Unsigned<kBytes> load_unsigned(const std::uint8_t* from) {
  if constexpr (kBytes == 8)
    return static_cast<unsigned long long>(load_word(from + 4)) << 32 | load_word(from);
  else
    return static_cast<Unsigned<kBytes>>(load_word(from));
}

template <int kBytes>
__device__ int count_bits(Unsigned<kBytes> bits) {
  if constexpr (kBytes == 8)
    return __popc(static_cast<std::uint32_t>(bits)) +
           __popc(static_cast<std::uint32_t>(bits >> 32));
  else
    return __popc(bits);
}

/// The sum over the lanes of a warp before this one.
__device__ inline std::uint32_t sum_below(int lane, std::uint32_t value) {
  std::uint32_t sum = value;
#pragma unroll
  for (int step = 1; step < 32; step *= 2) {
    const std::uint32_t other = __shfl_sync(kAllLanes, sum, lane - step);
    if (lane >= step) sum += other;
  }
  return sum - value;
}

/// What a group of a block is made of; offsets are from the block's first byte.
template <int kBytes>
struct GroupPlace {
  Unsigned<kBytes> present, sparse;
  std::uint16_t columns, planes;
};

/// What a warp knows of a block that it decodes.
template <int kBytes>
struct DecodedBlock {
  const std::uint8_t* bytes;
  Unsigned<kBytes> base;
  std::uint32_t axes;
  std::uint32_t good;  ///< false: nothing of it is decoded
  GroupPlace<kBytes> groups[packed::kGroups];
};

/// Looks for the groups of the block in bytes [begin, end), a thread a group. By a whole warp.
template <int kBytes>
__device__ void find_groups(DecodedBlock<kBytes>& block, const std::uint8_t* begin,
                            std::uint32_t size, int lane) {
  using U = Unsigned<kBytes>;
  constexpr std::uint32_t kHeads = kBytes + 5;
  bool good = size == kBytes || size >= kHeads;
  const bool varies = good && size > kBytes;
  const std::uint32_t groups = varies ? load_word(begin + kBytes + 1) : 0;
  const std::uint32_t axes = varies ? load_word(begin + kBytes) & 0xff : 0;
  const std::uint32_t columns = kHeads + 2 * kBytes * static_cast<std::uint32_t>(__popc(groups));
  good = good && axes <= packed::all_axes && (!varies || columns <= size);
  U present = 0, sparse = 0;
  if (good && (groups >> lane & 1)) {
    const int before = __popc(groups & ((1u << lane) - 1));
    const std::uint8_t* const head = begin + kHeads + 2 * kBytes * before;
    present = load_unsigned<kBytes>(head);
    sparse = load_unsigned<kBytes>(head + kBytes);
  }
  good = good && (sparse & static_cast<U>(~present)) == 0;
  const auto sparse_planes = static_cast<std::uint32_t>(count_bits<kBytes>(sparse));
  const std::uint32_t own_columns = columns + 2 * sum_below(lane, sparse_planes);
  const std::uint32_t planes = columns + 2 * __reduce_add_sync(kAllLanes, sparse_planes);
  good = __all_sync(kAllLanes, good && (!varies || planes <= size));
  std::uint32_t bytes = packed::kPlaneBytes *
                        (static_cast<std::uint32_t>(count_bits<kBytes>(present)) - sparse_planes);
  for (std::uint32_t i = 0; good && i < sparse_planes; ++i)
    bytes += static_cast<std::uint32_t>(__popc(load_word(begin + own_columns + 2 * i) & 0xffff));
  const std::uint32_t own_planes = planes + sum_below(lane, bytes);
  const std::uint32_t total = planes + __reduce_add_sync(kAllLanes, bytes);
  good = good && (!varies || total == size);
  block.groups[lane] = {good ? present : U{0}, good ? sparse : U{0},
                        static_cast<std::uint16_t>(good ? own_columns : 0),
                        static_cast<std::uint16_t>(good ? own_planes : 0)};
  if (lane == 0) {
    block.bytes = begin;
    block.base = good ? load_unsigned<kBytes>(begin) : U{0};
    block.axes = axes;
    block.good = good;
  }
}

/// Four columns of a plane, eight rows a byte. `columns` are those that are not zero, `quarter`
/// which four of them. Reads some bytes whatever they are: a branch would cost more.
__device__ inline std::uint32_t load_columns(const std::uint8_t* plane, std::uint32_t columns,
                                             int quarter, const std::uint32_t* expand) {
  const int before = __popc(columns & ((1u << 4 * quarter) - 1));
  return __byte_perm(load_word(plane + before), 0, expand[columns >> 4 * quarter & 15]);
}

/// Planes become rows: bit i of byte x of word y for bit y of byte x of word i.
__device__ inline void transpose_planes(std::uint32_t (&words)[packed::kRows]) {
  constexpr std::uint32_t masks[] = {0x55555555u, 0x33333333u, 0x0f0f0f0fu};
#pragma unroll
  for (int stage = 0; stage < 3; ++stage) {
    const int step = 1 << stage;
#pragma unroll
    for (int i = 0; i < packed::kRows; ++i) {
      if (i & step) continue;
      const std::uint32_t swapped = ((words[i] >> step) ^ words[i + step]) & masks[stage];
      words[i + step] ^= swapped;
      words[i] ^= swapped << step;
    }
  }
}

/// Eight rows of four differences, of a group that a warp's threads each have. By a whole warp.
template <int kBytes>
__device__ void load_rows(const DecodedBlock<kBytes>& block, int group, int quarter,
                          const std::uint32_t* expand, Quad<kBytes> (&rows)[packed::kRows]) {
  const GroupPlace<kBytes>& place = block.groups[group];
  const std::uint8_t* columns = block.bytes + place.columns;
  const std::uint8_t* planes = block.bytes + place.planes;
  std::uint32_t bytes[kBytes][packed::kRows];
#pragma unroll
  for (int k = 0; k < kBytes; ++k) {
    const auto present = static_cast<std::uint32_t>(place.present >> 8 * k) & 0xff,
               sparse = static_cast<std::uint32_t>(place.sparse >> 8 * k) & 0xff;
    const std::uint32_t any = __reduce_or_sync(kAllLanes, present);
    // First which columns there are: then all planes can be read at once.
    std::uint32_t set[packed::kRows];
#pragma unroll
    for (int i = 0; i < packed::kRows; ++i) {
      set[i] = 0;
      if (!(any >> i & 1)) continue;
      const std::uint32_t some = load_word(columns) & 0xffff, is_sparse = sparse >> i & 1;
      set[i] = is_sparse ? some : 0xffffu * (present >> i & 1);
      columns += 2 * is_sparse;
    }
#pragma unroll
    for (int i = 0; i < packed::kRows; ++i) {
      bytes[k][i] = 0;
      if (!(any >> i & 1)) continue;
      bytes[k][i] = load_columns(planes, set[i], quarter, expand);
      planes += __popc(set[i]);
    }
    if (any != 0) transpose_planes(bytes[k]);
  }
#pragma unroll
  for (int y = 0; y < packed::kRows; ++y) {
    std::uint32_t of_row[kBytes];
#pragma unroll
    for (int k = 0; k < kBytes; ++k) of_row[k] = bytes[k][y];
    rows[y] = Quad<kBytes>(Quad<kBytes>::of_bytes(of_row).differences());
  }
}

/// Sums of differences along x and y, and the base. By a whole warp; each eight threads have a
/// block of their own.
template <int kBytes>
__device__ void add_rows(const DecodedBlock<kBytes>& block, int lane,
                         Quad<kBytes> (&rows)[packed::kRows]) {
  const int quarter = lane & 3;
  const bool along_x = (block.axes & packed::along_x) != 0;
  if (__any_sync(kAllLanes, along_x)) {
#pragma unroll
    for (int y = 0; y < packed::kRows; ++y) {
      const Quad<kBytes> own = rows[y].sums();
      Quad<kBytes> before = own.last();
#pragma unroll
      for (int step = 1; step < 4; step *= 2) {
        const Quad<kBytes> other = before.from_lane(lane - step);
        before = before + Quad<kBytes>(other.or_zero(quarter >= step));
      }
      const Quad<kBytes> left = before.from_lane(lane - 1);
      if (along_x) rows[y] = own + Quad<kBytes>(left.or_zero(quarter >= 1));
    }
  }
  const bool along_y = (block.axes & packed::along_y) != 0;
  if (along_y) {
#pragma unroll
    for (int y = 1; y < packed::kRows; ++y) rows[y] = rows[y] + rows[y - 1];
  }
  const auto base = static_cast<unsigned long long>(block.base);
  const Quad<kBytes> first(
      Quad<kBytes>::of(static_cast<std::uint32_t>(base), static_cast<std::uint32_t>(base >> 32)));
  Quad<kBytes> above = first;
  if (__any_sync(kAllLanes, along_y)) {
    const Quad<kBytes> other = rows[packed::kRows - 1].from_lane(lane - 4);
    above = above + Quad<kBytes>(other.or_zero(along_y && (lane & 4) != 0));
  }
#pragma unroll
  for (int y = 0; y < packed::kRows; ++y) rows[y] = rows[y] + above;
}

/// Where the samples of a brick go, and what they are made of.
template <int kBytes, int kSampleBytes, bool kFloating>
struct SampleStore {
  using Code = Unsigned<kBytes>;
  using Sample = Unsigned<kSampleBytes>;

  Sample* samples;
  const std::uint8_t* values;  ///< of the palette, if there is one
  std::uint32_t entries;
  std::int32_t extent[3];
  bool damaged = false;

  /// Four samples in order, from (x, y, z) on.
  __device__ void put(int x, int y, int z, const Quad<kBytes>& quad) {
    if (y >= extent[1] || z >= extent[2] || x >= extent[0]) return;
    Sample* const to = samples + (static_cast<std::int64_t>(z) * extent[1] + y) * extent[0] + x;
    if constexpr (kBytes == kSampleBytes && !kFloating)
      if (extent[0] % 4 == 0) return quad.store(to);
#pragma unroll
    for (int i = 0; i < 4; ++i)
      if (x + i < extent[0]) to[i] = sample_of(quad.at(i));
  }

 private:
  __device__ Sample sample_of(Code code) {
    if constexpr (kBytes != kSampleBytes) {
      if (code >= entries) {
        damaged = true;
        return 0;
      }
      return load_unsigned<kSampleBytes>(values + code * kSampleBytes);
    } else if constexpr (kFloating) {
      constexpr Code kTop = Code{1} << (8 * kBytes - 1);
      return code & kTop ? code ^ kTop : ~code;
    } else {
      return code;
    }
  }
};

/// Decodes a block with eight threads; `first` is its first sample. By a whole warp.
template <int kBytes, class Store>
__device__ void decode_block(const DecodedBlock<kBytes>& block, const int (&first)[3], int lane,
                             const std::uint32_t* expand, Store& store) {
  const int quarter = lane & 3, half = lane >> 2 & 1;
  const bool along_z = (block.axes & packed::along_z) != 0;
  Quad<kBytes> sums[packed::kRows], rows[packed::kRows];
  for (int z = 0; z < packed::kEdge; ++z) {
    const int group = 2 * z + half;
    const bool varies = block.groups[group].present != 0;
    // Where nothing changes along z the rows are those of before.
    if (__any_sync(kAllLanes, varies || z == 0 || !along_z)) {
      load_rows(block, group, quarter, expand, rows);
#pragma unroll
      for (int y = 0; y < packed::kRows; ++y)
        sums[y] = rows[y] + Quad<kBytes>(sums[y].or_zero(along_z));
#pragma unroll
      for (int y = 0; y < packed::kRows; ++y) rows[y] = sums[y];
      add_rows(block, lane, rows);
    }
    if (!block.good) continue;
#pragma unroll
    for (int y = 0; y < packed::kRows; ++y)
      store.put(first[0] + 4 * quarter, first[1] + packed::kRows * half + y, first[2] + z, rows[y]);
  }
}

/// What __byte_perm() is to choose so that bytes go to the columns that are set.
__device__ inline std::uint32_t expansion_of(std::uint32_t columns) {
  std::uint32_t choice = 0, next = 0;
  for (int x = 0; x < 4; ++x) choice |= (columns >> x & 1 ? next++ : 4) << 4 * x;
  return choice;
}

/// Bytes of these blocks come nearer while others are looked at. By a whole warp.
__device__ inline void prefetch_blocks(const std::uint8_t* ends, const std::uint8_t* bytes,
                                       std::uint32_t begin, std::uint32_t end, int lane) {
  if (begin >= end) return;
  constexpr std::uint32_t kLine = 128;
  const std::uint32_t last = load_word(ends + 4 * (end - 1));
  std::uint32_t at = begin == 0 ? 0 : load_word(ends + 4 * (begin - 1));
  for (at += kLine * static_cast<std::uint32_t>(lane); at < last; at += kLine * 32)
    prefetch(bytes + at);
}

template <int kBytes>
struct DecodeShared {
  std::uint32_t expand[16];
  DecodedBlock<kBytes> blocks[kDecodeWarps][kBlocksOfWarp];
};

/// The blocks of a warp, from block `begin` of the brick on.
template <int kBytes, class Store>
__device__ void decode_blocks(DecodeShared<kBytes>& shared, const DecodeParams& p,
                              const PackedOnDevice& brick, std::uint32_t begin, Store store) {
  const int lane = static_cast<int>(threadIdx.x & 31), warp = static_cast<int>(threadIdx.x >> 5);
  const auto count = static_cast<std::uint32_t>(p.blocks[0] * p.blocks[1] * p.blocks[2]);
  const std::uint8_t* const ends = brick.from + sizeof(packed::BrickHeader);
  const std::uint8_t* const bytes =
      ends + std::size_t{count} * 4 + std::size_t{brick.palette} * sizeof(typename Store::Sample);
  if (threadIdx.x < 16) shared.expand[threadIdx.x] = expansion_of(threadIdx.x);
  DecodedBlock<kBytes>(&blocks)[kBlocksOfWarp] = shared.blocks[warp];
  bool good = true;
  prefetch_blocks(ends, bytes, begin, ::min(begin + kBlocksOfWarp, count), lane);
  for (std::uint32_t i = 0; i < kBlocksOfWarp; ++i) {
    const std::uint32_t number = begin + i;
    if (number >= count) {
      blocks[i].groups[lane] = {};
      if (lane == 0) {
        blocks[i].bytes = bytes;
        blocks[i].axes = 0;
        blocks[i].good = 0;
      }
      continue;
    }
    const std::uint32_t from = number == 0 ? 0 : load_word(ends + 4 * (number - 1));
    find_groups(blocks[i], bytes + from, load_word(ends + 4 * number) - from, lane);
    __syncwarp();
    good = good && blocks[i].good;
  }
  __syncthreads();
  const std::uint32_t own = begin + static_cast<std::uint32_t>(lane >> 3);
  const auto nx = static_cast<std::uint32_t>(p.blocks[0]),
             ny = static_cast<std::uint32_t>(p.blocks[1]);
  const int first[3] = {static_cast<int>(own % nx) * packed::kEdge,
                        static_cast<int>(own / nx % ny) * packed::kEdge,
                        static_cast<int>(own / nx / ny) * packed::kEdge};
  decode_block(blocks[lane >> 3], first, lane, shared.expand, store);
  if (!good || store.damaged) atomicMin(p.failed, brick.number);
}

/// A part of plain samples, which lie behind the header.
__device__ inline void copy_plain(const PackedOnDevice& brick, std::size_t bytes,
                                  std::uint32_t part, std::uint32_t parts) {
  const std::uint8_t* const from = brick.from + sizeof(packed::BrickHeader);
  auto* const to = static_cast<std::uint8_t*>(brick.to);
  const std::size_t words = bytes / 4, step = std::size_t{parts} * 32 * kDecodeWarps;
  const std::size_t thread = std::size_t{part} * 32 * kDecodeWarps + threadIdx.x;
  for (std::size_t i = thread; i < words; i += step)
    reinterpret_cast<std::uint32_t*>(to)[i] = reinterpret_cast<const std::uint32_t*>(from)[i];
  if (thread < bytes % 4) to[4 * words + thread] = from[4 * words + thread];
}

/// `parts` blocks of threads a brick.
template <int kSampleBytes, bool kFloating>
__global__ void __launch_bounds__(32 * kDecodeWarps)
    decode_bricks(const __grid_constant__ DecodeParams p) {
  const PackedOnDevice brick = p.bricks[blockIdx.x / p.parts];
  const std::uint32_t begin = blockIdx.x % p.parts * kBlocksOfPart +
                              (threadIdx.x >> 5) * static_cast<std::uint32_t>(kBlocksOfWarp);
  const auto count = static_cast<std::uint32_t>(p.blocks[0] * p.blocks[1] * p.blocks[2]);
  if (brick.is_plain) {
    const std::size_t size = std::size_t{kSampleBytes} * static_cast<std::size_t>(p.extent[0]) *
                             static_cast<std::size_t>(p.extent[1]) *
                             static_cast<std::size_t>(p.extent[2]);
    return copy_plain(brick, size, blockIdx.x % p.parts, p.parts);
  }
  auto* const samples = static_cast<Unsigned<kSampleBytes>*>(brick.to);
  const std::uint8_t* const values =
      brick.from + sizeof(packed::BrickHeader) + std::size_t{count} * 4;
  if constexpr (kSampleBytes > 1) {
    if (brick.palette > 0) {
      __shared__ DecodeShared<1> shared;
      return decode_blocks(
          shared, p, brick, begin,
          SampleStore<1, kSampleBytes, false>{
              samples, values, brick.palette, {p.extent[0], p.extent[1], p.extent[2]}});
    }
  }
  __shared__ DecodeShared<kSampleBytes> shared;
  decode_blocks(shared, p, brick, begin,
                SampleStore<kSampleBytes, kSampleBytes, kFloating>{
                    samples, values, 0, {p.extent[0], p.extent[1], p.extent[2]}});
}

}  // namespace isobrick::gpu
