#include "pipeline/index/value_counts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <mutex>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include <isobrick/range.h>

namespace isobrick::inline v0 {
namespace {

/// Samples that are looked at together. Where all are equal, they are counted at once.
constexpr std::size_t kRun = 4096;

/// The whole number that has as many bits as `T`.
template <class T>
using Bits = std::conditional_t<sizeof(T) == 8, std::int64_t, std::int32_t>;

/// The bins of type `T` of one width, 2^exponent. Bin i covers [i, i + 1) · 2^exponent.
template <class T>
class Bins {
 public:
  /// A bin's slot in a table is the rest of its number: of as many bins in a row as the table has
  /// slots each has its own.
  using Slot = std::conditional_t<sizeof(T) == 1, std::uint8_t, std::uint16_t>;
  static constexpr std::size_t kSlots = std::size_t{1} << (8 * sizeof(Slot));

  int exponent() const { return exponent_; }
  std::int64_t bin(T value) const {
    if constexpr (std::is_floating_point_v<T>)
      return floor_bin(value);
    else
      return static_cast<std::int64_t>(value) >> exponent_;
  }
  Slot slot(T value) const { return static_cast<Slot>(bin(value)); }

  /// Makes the bins as narrow as the values of `range` allow, but no narrower than they are. The
  /// narrowest of a range are no narrower than those of a part of it, so a range may grow.
  void widen(ValueRange<T> range) {
    if constexpr (std::is_floating_point_v<T>) {
      const T largest = std::max(std::abs(range.lo), std::abs(range.hi));
      // Bins no narrower than the largest values are apart have numbers that are exact.
      int above = 0;  // the values are below 2^above
      if (std::frexp(largest, &above) > 0)
        set(std::max(exponent_, above - std::numeric_limits<T>::digits));
    }
    while (bin(range.hi) - bin(range.lo) >= static_cast<std::int64_t>(kSlots)) set(exponent_ + 1);
  }

  /// The slots of many values.
  void slots(const T* values, std::size_t count, Slot* out) const {
    if constexpr (std::is_floating_point_v<T>)
      for (std::size_t i = 0; i < count; ++i) out[i] = static_cast<Slot>(floor_bin(values[i]));
    else
      for (std::size_t i = 0; i < count; ++i) out[i] = static_cast<Slot>(values[i] >> exponent_);
  }

 private:
  /// So that 1 / width is finite.
  static constexpr int kMinExponent = !std::is_floating_point_v<T> ? 0
                                      : sizeof(T) == 4             ? -126
                                                                   : -1000;

  void set(int exponent) {
    exponent_ = exponent;
    if constexpr (std::is_floating_point_v<T>) {
      width_ = std::ldexp(T{1}, exponent);
      per_width_ = std::ldexp(T{1}, -exponent);
    }
  }

  /// Compares with the product of the bin's number, which is exact: the quotient of a tiny negative
  /// value may be zero.
  Bits<T> floor_bin(T value) const {
    const auto bin = static_cast<Bits<T>>(value * per_width_);
    return bin - (static_cast<T>(bin) * width_ > value ? 1 : 0);
  }

  int exponent_ = kMinExponent;
  T width_ = static_cast<T>(std::is_floating_point_v<T> ? std::ldexp(1.0, kMinExponent) : 1.0);
  T per_width_ = static_cast<T>(std::is_floating_point_v<T> ? std::ldexp(1.0, -kMinExponent) : 1.0);
};

/// As integers that processors compare many of at a time: bytes without a sign, others with one.
template <class T>
using Key = std::conditional_t<sizeof(T) == 1, std::uint8_t,
                               std::conditional_t<sizeof(T) == 2, std::int16_t, std::int32_t>>;
/// Where `T` has the other sign, the bit that makes the order the same.
template <class T>
constexpr auto kSign = static_cast<Key<T>>(std::is_signed_v<T> == std::is_signed_v<Key<T>>
                                               ? std::uint64_t{0}
                                               : std::uint64_t{1} << (8 * sizeof(T) - 1));

/// The smallest and the largest of some integers.
template <class T>
ValueRange<T> range_of(const T* values, std::size_t count) {
  const auto key = [](T value) {
    return static_cast<Key<T>>(static_cast<Key<T>>(value) ^ kSign<T>);
  };
  auto lo = key(values[0]), hi = lo;
  for (std::size_t i = 1; i < count; ++i) {
    const auto k = key(values[i]);
    lo = k < lo ? k : lo;
    hi = k > hi ? k : hi;
  }
  return {static_cast<T>(lo ^ kSign<T>), static_cast<T>(hi ^ kSign<T>)};
}

/// The smallest and the largest of some numbers; nothing where one is not finite.
template <class T>
std::optional<ValueRange<T>> finite_range(const T* values, std::size_t count) {
  if constexpr (!std::is_floating_point_v<T>) {
    return range_of(values, count);
  } else {
    // Side by side, because the order of comparisons of fractions is not the compiler's to change.
    constexpr std::size_t kLanes = 64 / sizeof(T);
    T lo[kLanes], hi[kLanes];
    Bits<T> has_nan[kLanes] = {};
    std::fill_n(lo, kLanes, ValueRange<T>::kHighest);
    std::fill_n(hi, kLanes, ValueRange<T>::kLowest);
    const auto look_at = [&](std::size_t lane, T value) {
      lo[lane] = value < lo[lane] ? value : lo[lane];
      hi[lane] = value > hi[lane] ? value : hi[lane];
      has_nan[lane] |= value != value ? 1 : 0;
    };
    std::size_t i = 0;
    for (; i + kLanes <= count; i += kLanes)
      for (std::size_t lane = 0; lane < kLanes; ++lane) look_at(lane, values[i + lane]);
    for (; i < count; ++i) look_at(0, values[i]);
    ValueRange<T> range;
    bool finite = true;
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      range.include({lo[lane], hi[lane]});
      finite = finite && has_nan[lane] == 0;
    }
    finite = finite && range.lo >= std::numeric_limits<T>::lowest() &&
             range.hi <= std::numeric_limits<T>::max();
    if (!finite) return std::nullopt;
    // Which zero is there must not depend on the order of the samples.
    return ValueRange<T>{range.lo + T{0}, range.hi + T{0}};
  }
}

/// The counts of one thread. Several tables, so that equal neighbours do not wait for each other's
/// counter.
template <class T>
struct ThreadCounts {
  using Slot = typename Bins<T>::Slot;
  static constexpr std::size_t kTables = sizeof(T) == 1 ? 4 : 2;

  Bins<T> bins;
  ValueRange<T> range;
  std::uint64_t counted = 0;  ///< no more than a counter holds
  std::vector<std::uint32_t> tables = std::vector<std::uint32_t>(kTables * Bins<T>::kSlots);
  std::array<T, kRun> run;  ///< samples that are not in a row, or of which some are left out
  std::array<Slot, kRun> slots;

  std::uint64_t take(Slot slot) {
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < kTables; ++i)
      sum += std::exchange(tables[i * Bins<T>::kSlots + slot], 0);
    return sum;
  }

  void count(const T* values, std::size_t n) {
    if constexpr (sizeof(T) > 2) {
      bins.slots(values, n, slots.data());
      count_slots(slots.data(), n);
    } else {
      count_slots(reinterpret_cast<const Slot*>(values), n);
    }
  }

 private:
  void count_slots(const Slot* s, std::size_t n) {
    std::uint32_t* const table = tables.data();
    for (; n >= kTables; n -= kTables, s += kTables)
      for (std::size_t i = 0; i < kTables; ++i) ++table[i * Bins<T>::kSlots + s[i]];
    for (; n > 0; --n) ++table[*s++];
  }
};

template <class T>
class TypedValueCounts final : public ValueCounts {
 public:
  void add(const std::byte* samples, Box3 box, Box3 part) override {
    auto thread = borrow();
    const T* typed = reinterpret_cast<const T*>(samples);
    const Int3 all = box.extent(), e = part.extent();
    const auto at = [&](Index y, Index z) {
      return typed + linear_index(part.lo + Int3{0, y, z} - box.lo, all);
    };
    const auto width = static_cast<std::size_t>(e.x);
    if (all.x == e.x) {
      for (Index z = 0; z < e.z; ++z)
        add_all(*thread, at(0, z), width * static_cast<std::size_t>(e.y));
    } else if (width >= kRun / 2) {
      for_each_row(e, [&](Index y, Index z) { add_all(*thread, at(y, z), width); });
    } else {
      std::size_t gathered = 0;
      for_each_row(e, [&](Index y, Index z) {
        if (gathered + width > kRun)
          add_run(*thread, thread->run.data(), std::exchange(gathered, 0));
        std::copy_n(at(y, z), width, thread->run.data() + gathered);
        gathered += width;
      });
      if (gathered > 0) add_run(*thread, thread->run.data(), gathered);
    }
    const std::lock_guard lock(mutex_);
    idle_.push_back(std::move(thread));
  }

  void add(double value, std::uint64_t times) override {
    const std::lock_guard lock(mutex_);
    if (times == 0) return;
    if (!std::isfinite(value)) {
      (std::isnan(value) ? not_a_number_ : infinite_) += times;
      return;
    }
    const T typed = static_cast<T>(static_cast<T>(value) + T{0});
    grow({typed, typed});
    counts_[bins_.slot(typed)] += times;
  }

  SampleCounts counts() override {
    for (const auto& thread : idle_) merge(*thread);
    SampleCounts all;
    all.bins.not_a_number = not_a_number_;
    all.bins.infinite = infinite_;
    if (range_.empty()) return all;
    all.bins.lo = static_cast<double>(range_.lo);
    all.bins.hi = static_cast<double>(range_.hi);
    all.bins.exponent = bins_.exponent();
    all.bins.first = bins_.bin(range_.lo);
    for (std::int64_t bin = all.bins.first; bin <= bins_.bin(range_.hi); ++bin)
      all.counts.push_back(counts_[static_cast<Slot>(bin)]);
    all.bins.count = static_cast<Index>(all.counts.size());
    return all;
  }

 private:
  using Thread = ThreadCounts<T>;
  using Slot = typename Bins<T>::Slot;

  template <class F>
  static void for_each_row(Int3 extent, const F& f) {
    for (Index z = 0; z < extent.z; ++z)
      for (Index y = 0; y < extent.y; ++y) f(y, z);
  }

  /// As many are made as threads add at the same time.
  std::unique_ptr<Thread> borrow() {
    const std::lock_guard lock(mutex_);
    if (idle_.empty()) return std::make_unique<Thread>();
    auto thread = std::move(idle_.back());
    idle_.pop_back();
    return thread;
  }

  void add_all(Thread& thread, const T* values, std::size_t count) {
    for (; count > kRun; count -= kRun, values += kRun) add_run(thread, values, kRun);
    if (count > 0) add_run(thread, values, count);
  }

  void add_run(Thread& thread, const T* values, std::size_t count) {
    auto range = finite_range(values, count);
    if (!range) {
      count = leave_out(values, count, thread.run.data());
      if (count == 0) return;
      values = thread.run.data();
      range = finite_range(values, count);
    }
    if (thread.counted + count > std::numeric_limits<std::uint32_t>::max()) merge_locked(thread);
    ValueRange<T> both = thread.range;
    both.include(*range);
    if (both != thread.range) {
      Bins<T> wider = thread.bins;
      wider.widen(both);
      if (wider.exponent() != thread.bins.exponent()) merge_locked(thread);
      thread.bins = wider;
      thread.range = both;
    }
    if (range->lo == range->hi)
      thread.tables[thread.bins.slot(range->lo)] += static_cast<std::uint32_t>(count);
    else
      thread.count(values, count);
    thread.counted += count;
  }

  /// Copies the finite values and counts the others; `out` may be `values`.
  std::size_t leave_out(const T* values, std::size_t count, T* out) {
    std::size_t finite = 0;
    std::uint64_t not_a_number = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const T value = values[i];
      not_a_number += value != value;
      if (std::isfinite(static_cast<double>(value))) out[finite++] = value;
    }
    const std::lock_guard lock(mutex_);
    not_a_number_ += not_a_number;
    infinite_ += count - finite - not_a_number;
    return finite;
  }

  void merge_locked(Thread& thread) {
    const std::lock_guard lock(mutex_);
    merge(thread);
  }

  /// Moves a thread's counts to those of all.
  void merge(Thread& thread) {
    if (thread.counted == 0) return;
    grow(thread.range);
    const int shift = std::min(bins_.exponent() - thread.bins.exponent(), 63);
    const std::int64_t last = thread.bins.bin(thread.range.hi);
    for (std::int64_t bin = thread.bins.bin(thread.range.lo); bin <= last; ++bin)
      counts_[static_cast<Slot>(bin >> shift)] += thread.take(static_cast<Slot>(bin));
    thread.counted = 0;
  }

  /// Makes room for the values of `range`.
  void grow(ValueRange<T> range) {
    ValueRange<T> both = range_;
    both.include(range);
    Bins<T> wider = bins_;
    wider.widen(both);
    if (wider.exponent() != bins_.exponent() && !range_.empty()) {
      std::vector<std::uint64_t> merged(Bins<T>::kSlots);
      const int shift = std::min(wider.exponent() - bins_.exponent(), 63);
      for (std::int64_t bin = bins_.bin(range_.lo); bin <= bins_.bin(range_.hi); ++bin)
        merged[static_cast<Slot>(bin >> shift)] += counts_[static_cast<Slot>(bin)];
      counts_.swap(merged);
    }
    bins_ = wider;
    range_ = both;
  }

  std::mutex mutex_;
  std::vector<std::unique_ptr<Thread>> idle_;
  Bins<T> bins_;
  ValueRange<T> range_;  ///< of what is in `counts_`
  std::vector<std::uint64_t> counts_ = std::vector<std::uint64_t>(Bins<T>::kSlots);
  std::uint64_t not_a_number_ = 0, infinite_ = 0;
};

/// Counts 64-bit integers as the nearest doubles.
class RoundedValueCounts final : public ValueCounts {
 public:
  explicit RoundedValueCounts(ScalarType type) : type_(type) {}

  void add(const std::byte* samples, Box3 box, Box3 part) override {
    visit_sample(type_, [&](auto tag) {
      add_typed(reinterpret_cast<const typename decltype(tag)::type*>(samples), box, part);
    });
  }
  void add(double value, std::uint64_t times) override { counts_.add(value, times); }
  SampleCounts counts() override { return counts_.counts(); }

 private:
  template <class T>
  void add_typed(const T* samples, Box3 box, Box3 part) {
    std::array<double, kRun> run;
    std::size_t gathered = 0;
    const auto flush = [&] {
      const Box3 row{{0, 0, 0}, {static_cast<Index>(gathered), 1, 1}};
      if (gathered > 0) counts_.add(reinterpret_cast<const std::byte*>(run.data()), row, row);
      gathered = 0;
    };
    for (Index z = part.lo.z; z < part.hi.z; ++z)
      for (Index y = part.lo.y; y < part.hi.y; ++y) {
        const T* row = samples + linear_index(Int3{part.lo.x, y, z} - box.lo, box.extent());
        for (Index x = 0; x < part.extent().x; ++x) {
          run[gathered++] = static_cast<double>(row[x]);
          if (gathered == kRun) flush();
        }
      }
    flush();
  }

  ScalarType type_;
  TypedValueCounts<double> counts_;
};

}  // namespace

std::unique_ptr<ValueCounts> make_value_counts(ScalarType type) {
  if (is_wide_integer(type)) return std::make_unique<RoundedValueCounts>(type);
  return visit_scalar(type, [](auto tag) -> std::unique_ptr<ValueCounts> {
    return std::make_unique<TypedValueCounts<typename decltype(tag)::type>>();
  });
}

void add_counts(const SampleCounts& from, ValueCounts& to) {
  const HistogramBins& bins = from.bins;
  to.add(std::nan(""), bins.not_a_number);
  to.add(HUGE_VAL, bins.infinite);
  for (std::size_t i = 0; i < from.counts.size(); ++i) {
    std::uint64_t count = from.counts[i];
    if (i + 1 == from.counts.size() && (i > 0 || count > 1)) {
      to.add(bins.hi, 1);
      --count;
    }
    const double edge =
        std::ldexp(static_cast<double>(bins.first + static_cast<std::int64_t>(i)), bins.exponent);
    to.add(std::max(bins.lo, edge), count);
  }
}

std::size_t value_counts_bytes(ScalarType type, int threads) {
  return visit_scalar(surface_type(type), [&](auto tag) {
    using T = typename decltype(tag)::type;
    // Twice what is shared: the bins before and after they are widened.
    return sizeof(TypedValueCounts<T>) + 2 * Bins<T>::kSlots * sizeof(std::uint64_t) +
           static_cast<std::size_t>(threads) *
               (sizeof(ThreadCounts<T>) +
                ThreadCounts<T>::kTables * Bins<T>::kSlots * sizeof(std::uint32_t));
  });
}

}  // namespace isobrick
