#include "index/label_lists.h"

#include <algorithm>
#include <cstring>
#include <iterator>

#include <fmt/format.h>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

void put_number(std::vector<std::byte>& out, std::uint64_t number) {
  for (; number >= 0x80; number >>= 7) out.push_back(static_cast<std::byte>(number | 0x80));
  out.push_back(static_cast<std::byte>(number));
}

/// Of any sign, small ones short.
std::uint64_t zigzag(std::int64_t label) {
  return static_cast<std::uint64_t>(label) << 1 ^ static_cast<std::uint64_t>(label >> 63);
}
std::int64_t unzigzag(std::uint64_t number) {
  return static_cast<std::int64_t>(number >> 1 ^ (~(number & 1) + 1));
}

/// The number of labels, 0 where the list is cut, else one more; then the first label, and the
/// steps between labels less 1.
void put_list(std::vector<std::byte>& out, const LabelList& list) {
  if (list.is_cut) return put_number(out, 0);
  put_number(out, list.labels.size() + 1);
  if (list.labels.empty()) return;
  put_number(out, zigzag(list.labels.front()));
  for (std::size_t i = 1; i < list.labels.size(); ++i)
    put_number(out, static_cast<std::uint64_t>(list.labels[i]) -
                        static_cast<std::uint64_t>(list.labels[i - 1]) - 1);
}

[[noreturn]] void broken() { throw DamageError("broken lists of labels"); }

class ListReader {
 public:
  explicit ListReader(std::span<const std::byte> bytes) : bytes_(bytes) {}

  LabelList list() {
    const std::uint64_t count = number();
    if (count == 0) return ended({{}, true});
    if (count - 1 > LabelList::kMaxLabels) broken();
    LabelList list;
    for (std::uint64_t i = 1; i < count; ++i) {
      if (i == 1) {
        list.labels.push_back(unzigzag(number()));
        continue;
      }
      const auto last = static_cast<std::uint64_t>(list.labels.back());
      const auto next = static_cast<std::int64_t>(last + number() + 1);
      if (next <= list.labels.back()) broken();
      list.labels.push_back(next);
    }
    return ended(std::move(list));
  }

 private:
  std::uint64_t number() {
    std::uint64_t value = 0;
    for (int shift = 0; shift < 64; shift += 7) {
      if (bytes_.empty()) broken();
      const auto byte = static_cast<std::uint64_t>(bytes_.front());
      bytes_ = bytes_.subspan(1);
      if (shift == 63 && byte > 1) broken();
      value |= (byte & 0x7f) << shift;
      if (byte < 0x80) return value;
    }
    broken();
  }
  LabelList ended(LabelList list) const {
    if (!bytes_.empty()) broken();
    return list;
  }

  std::span<const std::byte> bytes_;
};

}  // namespace

void LabelList::unite(const LabelList& other) {
  is_cut |= other.is_cut;
  std::vector<std::int64_t> all;
  if (!is_cut)
    std::set_union(labels.begin(), labels.end(), other.labels.begin(), other.labels.end(),
                   std::back_inserter(all));
  is_cut |= all.size() > kMaxLabels;
  if (is_cut) all.clear();
  labels = std::move(all);
}

std::vector<std::byte> pack_label_lists(std::span<const LabelList> lists) {
  std::vector<std::byte> bytes(sizeof(std::uint32_t) * (lists.size() + 1));
  for (std::size_t i = 0; i <= lists.size(); ++i) {
    const auto end = static_cast<std::uint32_t>(bytes.size());
    std::memcpy(bytes.data() + i * sizeof end, &end, sizeof end);
    if (i < lists.size()) put_list(bytes, lists[i]);
  }
  return bytes;
}

std::vector<LabelList> unpack_label_lists(std::span<const std::byte> bytes, std::size_t items) {
  const std::size_t head = sizeof(std::uint32_t) * (items + 1);
  if (bytes.size() < head) broken();
  std::vector<std::uint32_t> ends(items + 1);
  std::memcpy(ends.data(), bytes.data(), head);
  if (ends.front() != head || ends.back() != bytes.size() ||
      !std::is_sorted(ends.begin(), ends.end()))
    broken();
  std::vector<LabelList> lists;
  lists.reserve(items);
  for (std::size_t i = 0; i < items; ++i)
    lists.push_back(ListReader(bytes.subspan(ends[i], ends[i + 1] - ends[i])).list());
  return lists;
}

}  // namespace isobrick
