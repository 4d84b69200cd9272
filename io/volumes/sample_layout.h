#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include <isobrick/volume_source.h>
#include "io/bytes/byte_order.h"

namespace isobrick::inline v0 {

/// Where the samples of a volume lie among the bytes of a file or a stream.
struct SampleLayout {
  VolumeInfo info;           ///< `name` is the file's path
  std::uint64_t offset = 0;  ///< of the first sample, bytes
  bool swap = false;         ///< samples are of the other byte order
  /// Samples from one to the next along x, y and z, each at least what the axes
  /// before it take up; nothing: dense, C order [z, y, x].
  std::optional<Int3> stride = {};
  std::string header = {};              ///< path of their header, where it is a file of its own
  std::vector<std::string> notes = {};  ///< VolumeSource::notes() as far as they are known

  /// " 'x.hdr'" where there is such a file.
  std::string header_in_message() const { return header.empty() ? "" : " '" + header + "'"; }

  Int3 strides() const {
    return stride.value_or(Int3{1, info.extent.x, info.extent.x * info.extent.y});
  }
  bool dense() const { return strides() == Int3{1, info.extent.x, info.extent.x * info.extent.y}; }
  std::uint64_t offset_of(Int3 p) const {
    const Int3 s = strides();
    return offset +
           static_cast<std::uint64_t>(p.x * s.x + p.y * s.y + p.z * s.z) * size_of(info.type);
  }
  /// One after the last byte that belongs to the volume.
  std::uint64_t end() const { return offset_of(info.extent - Int3{1, 1, 1}) + size_of(info.type); }
};

/// The note that `count` bytes (`what`) after the samples (`after`) of a file are ignored. `name`
/// has its quotes.
inline std::string trailing_note(std::string_view name, std::uint64_t count,
                                 std::string_view what = "byte",
                                 std::string_view after = "the samples", bool at_least = false) {
  return fmt::format("{}: {}{} {}{} after {} {} ignored", name, at_least ? "at least " : "", count,
                     what, count == 1 ? "" : "s", after, count == 1 ? "is" : "are");
}

/// Gathers `count` samples, `stride` apart, from pieces that fetch(offset,
/// bytes, size) copies.
template <class Fetch>
void read_interleaved(std::uint64_t offset, Index count, Index stride, std::size_t sample,
                      Fetch&& fetch, std::byte* out) {
  constexpr std::size_t kPiece = 65536;
  const std::size_t step = static_cast<std::size_t>(stride) * sample;
  const Index batch = std::max<Index>(1, static_cast<Index>(kPiece / step));
  std::vector<std::byte> piece(static_cast<std::size_t>(std::min(batch, count) - 1) * step +
                               sample);
  for (Index i = 0; i < count; i += batch) {
    const auto n = static_cast<std::size_t>(std::min(batch, count - i));
    fetch(offset + static_cast<std::uint64_t>(i) * step, piece.data(), (n - 1) * step + sample);
    for (std::size_t j = 0; j < n; ++j, out += sample)
      std::memcpy(out, piece.data() + j * step, sample);
  }
}

/// Copies `box`, dense and in native byte order, to `out`: calls
/// fetch(offset, bytes, size) with offsets that increase.
template <class Fetch>
void read_samples(const SampleLayout& layout, Box3 box, Fetch&& fetch, std::byte* out) {
  const std::size_t sample = size_of(layout.info.type);
  const Int3 e = box.extent(), s = layout.strides();
  if (box.empty()) return;
  // What is contiguous is fetched at once: the box, its planes or its rows.
  const bool rows = s.x == 1, planes = rows && s.y == e.x, all = planes && s.z == e.x * e.y;
  const Int3 run{e.x, planes ? e.y : 1, all ? e.z : 1};
  const std::size_t bytes = static_cast<std::size_t>(volume(run)) * sample;
  std::byte* to = out;
  for (Index z = box.lo.z; z < box.hi.z; z += run.z)
    for (Index y = box.lo.y; y < box.hi.y; y += run.y, to += bytes) {
      const std::uint64_t at = layout.offset_of({box.lo.x, y, z});
      if (rows)
        fetch(at, to, bytes);
      else
        read_interleaved(at, e.x, s.x, sample, fetch, to);
    }
  if (layout.swap) swap_byte_order(out, static_cast<std::size_t>(volume(e)), sample);
}

}  // namespace isobrick
