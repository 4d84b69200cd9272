#pragma once

#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <utility>

namespace isobrick::inline v0 {

/// Shared values by 64-bit key, the least recently used dropped when the
/// weights exceed the budget. Thread-safe. A value in use outlives its eviction.
template <class Value>
class LruCache {
 public:
  explicit LruCache(std::uint64_t budget) : budget_(budget) {}

  /// The cached value or what `load()` makes, a pair (shared_ptr, weight). Two
  /// threads may load the same key at once; the first to finish wins.
  template <class Load>
  std::shared_ptr<const Value> get(std::uint64_t key, Load&& load) {
    {
      const std::lock_guard lock(mutex_);
      if (const auto found = entries_.find(key); found != entries_.end()) {
        order_.splice(order_.begin(), order_, found->second);
        return found->second->value;
      }
    }
    std::pair<std::shared_ptr<const Value>, std::uint64_t> loaded = load();
    const std::lock_guard lock(mutex_);
    if (const auto found = entries_.find(key); found != entries_.end()) return found->second->value;
    order_.push_front({key, loaded.second, loaded.first});
    entries_.emplace(key, order_.begin());
    weight_ += loaded.second;
    while (weight_ > budget_ && order_.size() > 1) {
      weight_ -= order_.back().weight;
      entries_.erase(order_.back().key);
      order_.pop_back();
    }
    return loaded.first;
  }

  /// The cached value or null; does not count as use.
  std::shared_ptr<const Value> find(std::uint64_t key) {
    const std::lock_guard lock(mutex_);
    const auto found = entries_.find(key);
    return found != entries_.end() ? found->second->value : nullptr;
  }

  /// Drops what is there.
  void clear() {
    const std::lock_guard lock(mutex_);
    entries_.clear();
    order_.clear();
    weight_ = 0;
  }

 private:
  struct Entry {
    std::uint64_t key, weight;
    std::shared_ptr<const Value> value;
  };
  std::mutex mutex_;
  std::uint64_t budget_, weight_ = 0;
  std::list<Entry> order_;
  std::unordered_map<std::uint64_t, typename std::list<Entry>::iterator> entries_;
};

}  // namespace isobrick
