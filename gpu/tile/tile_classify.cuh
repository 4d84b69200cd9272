#pragma once

#include <type_traits>

#include "gpu/tile/tile_row_groups.cuh"

// The inside bits of a tile's 33 × 33 rows, from global memory.

namespace isobrick::inline v0::gpu {

/// Which samples are inside. Narrow integers are compared within a word, 4 or 2 at
/// once: the upper bit of (x without it) + c is set where the
/// lower bits reach those of the threshold; it is joined with x's own.
template <class T>
struct Classifier {
  static constexpr bool kPacked = sizeof(T) <= 2 && std::is_integral_v<T>;
  T threshold;
  std::uint32_t addend = 0, either = 0;

  __device__ explicit Classifier(T t) : threshold(t) {
    if constexpr (kPacked) {
      using U = std::make_unsigned_t<T>;
      constexpr std::uint32_t bits = 8 * sizeof(T), top = 1u << (bits - 1);
      const std::uint32_t u = static_cast<U>(t) ^ (std::is_signed_v<T> ? top : 0u);
      either = u <= top ? ~0u : 0u;
      addend = (u <= top ? top - u : 2 * top - u) * (sizeof(T) == 1 ? 0x01010101u : 0x00010001u);
    }
  }

  /// The upper bit of each sample in the word: inside.
  __device__ std::uint32_t tops(std::uint32_t word) const {
    constexpr std::uint32_t top = sizeof(T) == 1 ? 0x80808080u : 0x80008000u;
    const std::uint32_t sum = (word & ~top) + addend;
    const std::uint32_t own = std::is_signed_v<T> ? ~word : word;
    return ((sum & own) | (either & (sum | own))) & top;
  }

  /// Bits of the samples of `words` (in memory order), the first in the lowest.
  template <int N>
  __device__ std::uint32_t bits(const std::uint32_t (&words)[N]) const {
    std::uint32_t result = 0;
    if constexpr (sizeof(T) == 1) {
      static_assert(N % 2 == 0);
#pragma unroll
      for (int i = 0; i < N; i += 2) {
        // Eight samples, each with its own power of two, times 128.
        const std::uint32_t four = __dp4a(tops(words[i]), 0x08040201u, 0u);
        const std::uint32_t eight = __dp4a(tops(words[i + 1]), 0x80402010u, four);
        result |= i == 0 ? eight >> 7 : eight << (4 * i - 7);
      }
    } else {
#pragma unroll
      for (int i = N - 1; i >= 0; --i) {
        const std::uint32_t both = tops(words[i]);
        result = __funnelshift_l(both | both << 15, result, 2);
      }
    }
    return result;
  }

  __device__ std::uint32_t one(T v) const { return v >= threshold ? 1u : 0u; }
};

/// Where the samples of a row lie, counted from sample (0, 0, 0) of the tile.
__device__ inline int row_start(int row, int z) { return (row - z) * 32; }

/// The block of a sample, each coordinate in −32 … 63.
__device__ inline int block_at(int x, int y, int z) {
  return 13 + (x >> 5) + 3 * (y >> 5) + 9 * (z >> 5);
}

/// The sample at `place` = x + 32·y + 1024·z, which lies in `block`.
template <class T>
__device__ inline const T* sample_at(const TileShared& s, int block, int place) {
  return reinterpret_cast<const T*>(s.tile_blocks[block]) + place;
}

/// The last sample of a row, which is the first of one of the next tile.
template <class T>
__device__ inline const T* column_at(const TileShared& s, const TileParams& p, int y, int z) {
  const int step = p.columns ? 1 : 32;
  return reinterpret_cast<const T*>(s.columns[(y >> 5) + 2 * (z >> 5)]) + (y + 32 * z) * step;
}

/// What a warp reads of a group of rows of narrow samples. Such a row is 32 or 64 bytes; two or
/// four lanes read one, 16 bytes each, and give each other the bits.
template <class T>
struct SamplesOfRows {
  static constexpr int kLanes = 2 * static_cast<int>(sizeof(T)), kAtOnce = 32 / kLanes;
  uint4 part[kLanes];  ///< of row i · kAtOnce + lane / kLanes
  T last;              ///< of the own row

  template <class Rows>
  __device__ static SamplesOfRows read(const TileShared& s, const TileParams& p, Rows rows) {
    const auto lane = static_cast<int>(lane_id());
    const auto start_of = [&](int y, int z) {
      return reinterpret_cast<const uint4*>(sample_at<T>(s, block_at(0, y, z), 32 * y + 1024 * z));
    };
    SamplesOfRows read;
    const uint4* plane = Rows::kPlane ? start_of(0, rows.z(0)) + lane : nullptr;
#pragma unroll
    for (int i = 0; i < kLanes; ++i) {
      const int row = i * kAtOnce + lane / kLanes;
      // The rows of a plane follow one another.
      read.part[i] =
          __ldg(Rows::kPlane ? plane + 32 * i
                             : start_of(rows.y(row), ::min(rows.z(row), 32)) + lane % kLanes);
    }
    const OwnRow own(rows);
    read.last = __ldg(column_at<T>(s, p, own.y, ::min(own.z, 32)));
    return read;
  }

  __device__ RowBits bits(const Classifier<T>& classifier) const {
    const auto lane = static_cast<int>(lane_id());
    std::uint32_t parts = 0, word = 0;
#pragma unroll
    for (int i = 0; i < kLanes; ++i) {
      const std::uint32_t words[4] = {part[i].x, part[i].y, part[i].z, part[i].w};
      parts |= classifier.bits(words) << i * kAtOnce;
    }
#pragma unroll
    for (int i = 0; i < kLanes; ++i) {
      const std::uint32_t part = __shfl_sync(kFullMask, parts, lane % kAtOnce * kLanes + i);
      word |= (part >> lane / kAtOnce * kAtOnce & ((1u << kAtOnce) - 1u)) << i * kAtOnce;
    }
    return {word, classifier.one(last)};
  }
};

/// A row a thread.
template <int N, class T>
__device__ inline void classify_rows(TileShared& s, const TileParams& p,
                                     const Classifier<T>& classifier) {
  for_each_row_group<N>([&](auto rows) {
    const OwnRow at(rows);
    const RowBits bits = SamplesOfRows<T>::read(s, p, rows).bits(classifier);
    if (at.exists()) s.rows[at.row()] = bits;
  });
}

/// A plane a warp and a sample a thread: rows of wide samples, read by one thread
/// each, would be fetched sector by sector, again and again.
template <int N, class T>
__device__ inline void classify_planes(TileShared& s, const TileParams& p,
                                       const Classifier<T>& classifier) {
  const int lane = static_cast<int>(lane_id());
  const auto inside = [&](T v) { return __ballot_sync(kFullMask, v >= classifier.threshold); };
  for (auto z = static_cast<int>(warp_id()); z < 33; z += BlockConfig<N>::kWarps) {
    const int block = block_at(0, 0, z), start = 1024 * z;
    const T* from = sample_at<T>(s, block, start + lane);
    std::uint32_t word = 0;
#pragma unroll 16
    for (int y = 0; y < 32; ++y) {
      const std::uint32_t row = inside(__ldg(from + 32 * y));
      if (lane == y) word = row;
    }
    const T last = __ldg(column_at<T>(s, p, lane, z));
    s.rows[33 * z + lane] = {word, classifier.one(last)};
    // The row at y = 32 lies in the tile above.
    const std::uint32_t top = inside(__ldg(sample_at<T>(s, block + 3, start + 1024 + lane)));
    const T corner = __ldg(column_at<T>(s, p, 32, z));
    if (lane == 0) s.rows[33 * z + 32] = {top, classifier.one(corner)};
  }
}

template <int N, class T>
__device__ inline void classify_samples(TileShared& s, const TileParams& p,
                                        const Classifier<T>& classifier) {
  if constexpr (sizeof(T) <= 2)
    classify_rows<N>(s, p, classifier);
  else
    classify_planes<N>(s, p, classifier);
}

/// Empties the lists, which held so many cells and vertices, or more than they have room for.
template <int N>
__device__ inline void clear_lists(TileShared& s, std::uint32_t cells, std::uint32_t vertices) {
  const uint4 zero{0, 0, 0, 0};
  auto& lists = lists_of<N>(s);
  cells = (::min(cells, lists.kListed) + 3) / 4;
  vertices = (::min(vertices, lists.kListed) + 7) / 8;
#pragma unroll 1
  for (unsigned i = own_thread(); i < cells; i += N)
    reinterpret_cast<uint4*>(lists.cells)[i] = zero;
#pragma unroll 1
  for (unsigned i = own_thread(); i < vertices; i += N)
    reinterpret_cast<uint4*>(lists.vertex_marks)[i] = zero;
}

}  // namespace isobrick::gpu
