#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <isobrick/range.h>
#include <isobrick/vec.h>
#include "index/index_format.h"

namespace isobrick::inline v0::gpu {

/// Span-space indices in device memory: the bytes of index/, searched there and
/// built there. One index, such as that of a volume's blocks, is searched by the
/// whole device; several, such as those of the cells of each brick, at once by
/// blocks of threads each. All eight types. Not thread-safe; the current device at
/// construction is used.
class SpanSearch {
 public:
  /// Uploads indices of one kind and type as they are; they have been opened or
  /// built. Throws UsageError when they are none or not alike, Error when device
  /// memory does not suffice.
  explicit SpanSearch(const std::vector<IndexView>& indices);

  /// Builds indices of one kind on the device: index i is that of the next
  /// volume(grids[i]) ranges, C order [z, y, x], and its bytes are those of
  /// build_index on the CPU. Throws UsageError when there is no grid, when the
  /// grids are not those of the ranges, and for 2³² − 1 ranges and more; Error when
  /// device memory does not suffice: at most some 160 bytes a range, 240 of f64.
  template <class T>
  SpanSearch(IndexKind kind, std::span<const ValueRange<T>> ranges, std::span<const Int3> grids);

  ~SpanSearch();
  SpanSearch(SpanSearch&&) noexcept;
  SpanSearch& operator=(SpanSearch&&) noexcept;

  IndexKind kind() const;
  ScalarType type() const;
  std::size_t size() const;  ///< indices
  /// Bytes of the indices, and of all device memory that is kept.
  std::uint64_t index_bytes() const;
  std::uint64_t device_bytes() const;

  /// The bytes of index i.
  std::vector<std::byte> download(std::size_t i) const;

  /// Finds the items that the isovalue stabs; their number, of all indices. The
  /// answers stay on the device until the next call.
  std::uint64_t search(double isovalue);
  /// The answers of the last search: ids ascending, those of index i from first[i]
  /// to first[i + 1].
  void answers(std::vector<std::uint32_t>& first, std::vector<std::uint32_t>& ids) const;

  /// Milliseconds on the device of the last search, from the isovalue to the list
  /// of ids, and of the build, without the copy of the ranges; for measuring.
  float search_milliseconds() const;
  float build_milliseconds() const;  ///< 0 for uploaded indices

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isobrick::gpu
