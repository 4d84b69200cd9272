#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace isobrick::inline v0 {

/// What FlatMap needs of keys: one that is never used, and a number that differs for most keys.
template <class Key>
struct FlatKey;
template <>
struct FlatKey<std::uint64_t> {
  static constexpr std::uint64_t kFree = ~std::uint64_t{0};
  static std::uint64_t number(std::uint64_t key) { return key; }
};

/// A hash map from numbers, or other small keys, to small values in one array, for bookkeeping that
/// is looked up for every tile. Any key but FlatKey<Key>::kFree. What it points to may move with
/// the next insertion or erasure.
template <class Value, class Key = std::uint64_t>
class FlatMap {
 public:
  /// With room for so many before it grows.
  explicit FlatMap(std::size_t expected = 8)
      : entries_(std::bit_ceil(2 * expected + 2)), shift_(shift_for(entries_.size())) {}

  std::size_t size() const { return size_; }
  bool contains(const Key& key) const { return find(key) != nullptr; }
  /// Null when the key is not there.
  const Value* find(const Key& key) const {
    const Entry& entry = entries_[place_of(key)];
    return entry.key == key ? &entry.value : nullptr;
  }
  Value* find(const Key& key) { return const_cast<Value*>(std::as_const(*this).find(key)); }
  /// The key's value, a new one when there is none, and whether it is new.
  std::pair<Value&, bool> insert(const Key& key) {
    std::size_t place = place_of(key);
    const bool added = entries_[place].key == kFree;
    if (added) {
      if (2 * (size_ + 1) > entries_.size()) {
        grow();
        place = place_of(key);
      }
      entries_[place] = {key, {}};
      ++size_;
    }
    return {entries_[place].value, added};
  }
  /// Calls f(key, value) for every key, in no order.
  template <class F>
  void for_each(F&& f) const {
    for (const Entry& entry : entries_)
      if (entry.key != kFree) f(entry.key, entry.value);
  }
  /// The key is there.
  void erase(const Key& key) {
    std::size_t hole = place_of(key);
    const std::size_t mask = entries_.size() - 1;
    // What follows moves up unless that would be before its own place.
    for (std::size_t i = (hole + 1) & mask; entries_[i].key != kFree; i = (i + 1) & mask)
      if (((i - home_of(entries_[i].key)) & mask) >= ((i - hole) & mask)) {
        entries_[hole] = std::move(entries_[i]);
        hole = i;
      }
    entries_[hole] = Entry{};
    --size_;
  }

 private:
  static constexpr Key kFree = FlatKey<Key>::kFree;
  struct Entry {
    Key key = kFree;
    Value value{};
  };

  static int shift_for(std::size_t size) { return 64 - std::countr_zero(size); }
  std::size_t home_of(const Key& key) const {
    return static_cast<std::size_t>(FlatKey<Key>::number(key) * 0x9e3779b97f4a7c15u >> shift_);
  }
  /// Where the key is, or belongs.
  std::size_t place_of(const Key& key) const {
    const std::size_t mask = entries_.size() - 1;
    std::size_t i = home_of(key);
    while (entries_[i].key != key && entries_[i].key != kFree) i = (i + 1) & mask;
    return i;
  }
  void grow() {
    std::vector<Entry> old(2 * entries_.size());
    old.swap(entries_);
    shift_ = shift_for(entries_.size());
    for (Entry& entry : old)
      if (entry.key != kFree) entries_[place_of(entry.key)] = std::move(entry);
  }

  std::vector<Entry> entries_;  ///< at most half of them in use; as many as a power of two
  int shift_;
  std::size_t size_ = 0;
};

}  // namespace isobrick
