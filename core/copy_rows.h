#pragma once

#include <cstddef>
#include <cstring>

#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// How far the rows and the planes of a box of samples are apart, in bytes.
struct RowStrides {
  Index row, plane;
};

namespace copy_rows_detail {

/// Copies rows of N samples, or of n.x when N is 0: of known length, a row is a move or two.
template <int N, std::size_t sample_bytes>
void copy(const std::byte* from, RowStrides from_strides, std::byte* to, RowStrides to_strides,
          Int3 n) {
  const std::size_t bytes = static_cast<std::size_t>(N ? N : n.x) * sample_bytes;
  for (Index z = 0; z < n.z; ++z)
    for (Index y = 0; y < n.y; ++y)
      std::memcpy(to + z * to_strides.plane + y * to_strides.row,
                  from + z * from_strides.plane + y * from_strides.row, bytes);
}

}  // namespace copy_rows_detail

/// Copies a box of n samples without gaps along x. Rows are mostly one of a few lengths: half a
/// tile or a whole one, with or without what it shares with its neighbours, or only that.
template <std::size_t sample_bytes>
void copy_rows(const std::byte* from, RowStrides from_strides, std::byte* to, RowStrides to_strides,
               Int3 n) {
  using namespace copy_rows_detail;
  switch (n.x) {
    case 1: return copy<1, sample_bytes>(from, from_strides, to, to_strides, n);
    case 16: return copy<16, sample_bytes>(from, from_strides, to, to_strides, n);
    case 17: return copy<17, sample_bytes>(from, from_strides, to, to_strides, n);
    case 32: return copy<32, sample_bytes>(from, from_strides, to, to_strides, n);
    case 33: return copy<33, sample_bytes>(from, from_strides, to, to_strides, n);
    case 34: return copy<34, sample_bytes>(from, from_strides, to, to_strides, n);
    case 35: return copy<35, sample_bytes>(from, from_strides, to, to_strides, n);
    default: return copy<0, sample_bytes>(from, from_strides, to, to_strides, n);
  }
}

}  // namespace isobrick
