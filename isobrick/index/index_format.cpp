#include "isobrick/index/index_format.h"

#include <cstring>
#include <string>

#include "isobrick/core/error.h"
#include "isobrick/index/span_index.h"

namespace isobrick {

namespace index_detail {

void require(bool holds, const char* what) {
  if (!holds) throw DamageError(std::string("index: ") + what);
}

}  // namespace index_detail

using index_detail::require;

namespace {

/// The header, once all that can be told without the arrays is right.
IndexHeader read_header(std::span<const std::byte> bytes) {
  require(bytes.size() >= sizeof(IndexHeader), "shorter than its header");
  IndexHeader header;
  // As numbers first: an enumeration must not hold what is none of its values.
  std::uint8_t head[8];
  std::memcpy(head, bytes.data(), sizeof head);
  constexpr std::uint32_t magic = IndexHeader::kMagic;
  require(std::memcmp(head, &magic, sizeof magic) == 0, "no index begins like this");
  require(head[4] == IndexHeader::kVersion, "of a version that this program does not know");
  require(head[5] < std::size(kIndexKinds), "of an unknown kind");
  require(head[6] < std::size(kScalarTypes), "of an unknown sample type");
  require(head[7] == 0, "reserved bytes are not zero");
  std::memcpy(&header, bytes.data(), sizeof header);
  require(header.reserved1 == 0, "reserved bytes are not zero");
  require(header.bytes == bytes.size(), "has not the size that its header says");
  require(header.stored <= header.items, "stores more items than there are");

  const std::uint64_t plane = std::uint64_t{header.grid[0]} * header.grid[1];
  require(plane == 0 || header.grid[2] <= ~std::uint64_t{0} / plane, "extents overflow");
  require(plane * header.grid[2] == header.items, "extents are not those of the items");
  return header;
}

}  // namespace

IndexView view_index(std::span<const std::byte> bytes) {
  if (reinterpret_cast<std::uintptr_t>(bytes.data()) % kIndexAlignment != 0)
    throw UsageError("the bytes of an index must lie at a multiple of 8");
  const IndexHeader header = read_header(bytes);
  // Measured before any pointer into the block exists.
  const std::uint64_t needed = visit_index(IndexView(header, nullptr), [&](const auto& view) {
    SectionCursor measure(nullptr);
    std::remove_cvref_t<decltype(view)>(header, measure);
    return measure.bytes();
  });
  require(needed == bytes.size(), "has not the size that its counts say");
  return IndexView(header, bytes.data());
}

IndexView open_index(std::span<const std::byte> bytes) {
  const IndexView index = view_index(bytes);
  visit_index(index, [&](const auto& view) { view.check(index.header()); });
  return index;
}

}  // namespace isobrick
