#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include <isobrick/index_kind.h>
#include <isobrick/scalar.h>
#include <isobrick/vec.h>
#include "core/host_device.h"

// An index is one block of bytes: a header, then the arrays of its kind, each at
// a multiple of 8. Where an array lies follows from the counts in the header, so
// no offset into the block is ever stored. docs/reference/index_format.md has the layouts.

namespace isobrick::inline v0 {

static_assert(std::endian::native == std::endian::little, "index bytes are used as they lie");

struct IndexHeader {
  static constexpr std::uint32_t kMagic = 0x58534249;  // "IBSX"
  static constexpr std::uint8_t kVersion = 1;

  std::uint32_t magic = kMagic;
  std::uint8_t version = kVersion;
  IndexKind kind = IndexKind::linear;
  ScalarType type = ScalarType::u8;
  std::uint8_t reserved0 = 0;
  std::uint64_t bytes = 0;     ///< of the whole block
  std::uint32_t items = 0;     ///< ids are below
  std::uint32_t stored = 0;    ///< items that some isovalue stabs
  std::uint32_t nodes = 0;     ///< interval tree: split values; quadtree: nodes
  std::uint32_t points = 0;    ///< quadtree: distinct (min, max)
  std::uint32_t grid[3] = {};  ///< extents x, y, z; their product is `items`
  std::uint32_t reserved1 = 0;
};
static_assert(sizeof(IndexHeader) == 48 && std::is_trivially_copyable_v<IndexHeader>);

/// Arrays of a block start at multiples of this, and so must the block itself.
inline constexpr std::size_t kIndexAlignment = 8;

/// Walks over the arrays of a block in their order. Without a block it only measures.
class SectionCursor {
 public:
  ISOBRICK_HD explicit SectionCursor(const std::byte* block) : block_(block) {}

  template <class T>
  ISOBRICK_HD const T* take(std::uint64_t count) {
    static_assert(std::is_trivially_copyable_v<T> && alignof(T) <= kIndexAlignment);
    const std::uint64_t at = bytes_;
    // Counts are of 32 bits and elements small: the sum of all arrays fits.
    bytes_ += (count * sizeof(T) + kIndexAlignment - 1) / kIndexAlignment * kIndexAlignment;
    return block_ ? reinterpret_cast<const T*>(block_ + at) : nullptr;
  }
  ISOBRICK_HD std::uint64_t bytes() const { return bytes_; }

 private:
  const std::byte* block_;
  std::uint64_t bytes_ = sizeof(IndexHeader);
};

/// An index over bytes that somebody else owns. Copies are cheap.
class IndexView {
 public:
  IndexView(const IndexHeader& header, const std::byte* block) : header_(header), block_(block) {}

  const IndexHeader& header() const { return header_; }
  const std::byte* block() const { return block_; }
  IndexKind kind() const { return header_.kind; }
  ScalarType type() const { return header_.type; }
  std::uint32_t items() const { return header_.items; }
  std::uint32_t stored() const { return header_.stored; }
  std::uint64_t bytes() const { return header_.bytes; }
  Int3 grid() const { return {header_.grid[0], header_.grid[1], header_.grid[2]}; }

 private:
  IndexHeader header_;
  const std::byte* block_;
};

/// A view of bytes that this program has built or has opened before: only the
/// header and the size are checked. The bytes lie at a multiple of
/// kIndexAlignment (UsageError) and outlive the view.
IndexView view_index(std::span<const std::byte> bytes);

/// A view of bytes from anywhere. Throws DamageError, saying what is wrong,
/// unless every count, offset and id is in its bounds and the arrays are in the
/// order that queries rely on; O(bytes). Whatever passes can be queried with no
/// access out of bounds and in finitely many steps. Only a
/// checksum proves that the answers are right.
IndexView open_index(std::span<const std::byte> bytes);

namespace index_detail {

/// Throws DamageError("index: " what) unless `holds`.
void require(bool holds, const char* what);

/// The header of an index over a grid of so many ranges, before anything is
/// counted. Throws UsageError as build_index does.
IndexHeader header_for(IndexKind kind, ScalarType type, std::size_t items, Int3 grid);

/// Bytes of the whole block, from the counts of its header.
std::uint64_t block_bytes(const IndexHeader& header);

/// A zeroed block for the arrays of View<T>, with its header in place.
template <class View>
std::vector<std::byte> make_block(IndexHeader header) {
  SectionCursor measure(nullptr);
  View(header, measure);
  header.bytes = measure.bytes();
  std::vector<std::byte> block(header.bytes);
  *reinterpret_cast<IndexHeader*>(block.data()) = header;
  return block;
}

template <class View>
ISOBRICK_HD View view_of(const IndexHeader& header, const std::byte* block) {
  SectionCursor cursor(block);
  return View(header, cursor);
}

/// Builders fill the block that they own through the view that reads it.
template <class T>
ISOBRICK_HD T* writable(const T* section) {
  return const_cast<T*>(section);
}

}  // namespace index_detail
}  // namespace isobrick
