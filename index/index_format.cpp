#include "index/index_format.h"

#include <cstring>
#include <limits>
#include <string>

#include <isobrick/error.h>
#include "index/span_index.h"

namespace isobrick::inline v0 {

namespace index_detail {

void require(bool holds, const char* what) {
  if (!holds) throw DamageError(std::string("index: ") + what);
}

IndexHeader header_for(IndexKind kind, ScalarType type, std::size_t items, Int3 grid) {
  constexpr Index limit = std::numeric_limits<std::uint32_t>::max();
  if (items > static_cast<std::size_t>(limit))
    throw UsageError("an index holds less than 2^32 items, not " + std::to_string(items));
  IndexHeader header;
  header.kind = kind;
  header.type = type;
  header.items = static_cast<std::uint32_t>(items);
  const bool positive = grid.x > 0 && grid.y > 0 && grid.z > 0;
  // Divided rather than multiplied: extents may be anything.
  const bool fits = positive ? grid.x <= limit && grid.y <= limit / grid.x &&
                                   grid.z <= limit / (grid.x * grid.y) &&
                                   volume(grid) == static_cast<Index>(items)
                             : items == 0;
  if (!fits)
    throw UsageError("the extents of an index do not give its " + std::to_string(items) +
                     " ranges");
  for (int axis = 0; axis < 3 && positive; ++axis)
    header.grid[axis] = static_cast<std::uint32_t>(grid[axis]);
  return header;
}

std::uint64_t block_bytes(const IndexHeader& header) {
  return visit_index(IndexView(header, nullptr), [&](const auto& view) {
    SectionCursor measure(nullptr);
    std::remove_cvref_t<decltype(view)>(header, measure);
    return measure.bytes();
  });
}

}  // namespace index_detail

using index_detail::require;

namespace {

/// The header, after all checks that need no arrays.
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
  require(head[6] < std::size(kSurfaceTypes), "of an unknown sample type");
  require(head[7] == 0, "reserved bytes are not zero");
  std::memcpy(&header, bytes.data(), sizeof header);
  require(header.reserved1 == 0, "reserved bytes are not zero");
  require(header.bytes == bytes.size(), "has not the size that its header states");
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
  require(index_detail::block_bytes(header) == bytes.size(),
          "has not the size that its counts make");
  return IndexView(header, bytes.data());
}

IndexView open_index(std::span<const std::byte> bytes) {
  const IndexView index = view_index(bytes);
  visit_index(index, [&](const auto& view) { view.check(index.header()); });
  return index;
}

}  // namespace isobrick
