#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

// The labels of items, such as the bricks of a label image. docs/reference/index_format.md has the
// bytes.

namespace isobrick::inline v0 {

/// The labels of an item.
struct LabelList {
  static constexpr std::size_t kMaxLabels = 1024;

  /// Ascending, each once. Those of u64 are the signed integers of the same bits.
  std::vector<std::int64_t> labels = {};
  bool is_cut = false;  ///< there are more than kMaxLabels: the item may have any

  /// Adds those of another item.
  void unite(const LabelList& other);
};

/// Bytes that so many lists take at most.
constexpr std::uint64_t max_label_list_bytes(std::uint64_t items) {
  // A label takes ten bytes at most, and the number of them two.
  return sizeof(std::uint32_t) * (items + 2) + items * (2 + 10 * LabelList::kMaxLabels);
}

/// The lists as they are stored.
std::vector<std::byte> pack_label_lists(std::span<const LabelList> lists);
/// Throws DamageError for bytes that are not the lists of so many items.
std::vector<LabelList> unpack_label_lists(std::span<const std::byte> bytes, std::size_t items);

}  // namespace isobrick
