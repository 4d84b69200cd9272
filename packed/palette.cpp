#include "packed/palette.h"

#include <algorithm>
#include <cstring>
#include <type_traits>

#include <isobrick/error.h>
#include "packed/bit_planes.h"

namespace isobrick::inline v0::packed {
namespace {

template <std::size_t bytes>
using Word = std::conditional_t<bytes == 2, std::uint16_t,
                                std::conditional_t<bytes == 4, std::uint32_t, std::uint64_t>>;

/// Values with a number each, found by their bits.
template <class U>
class ValueTable {
 public:
  /// False where there are too many different ones.
  bool add(U value) {
    std::size_t slot = slot_of(value);
    for (; used_[slot]; slot = (slot + 1) % kSlots)
      if (values_[slot] == value) return true;
    if (++count_ > kMaxPalette) return false;
    used_[slot] = true;
    values_[slot] = value;
    return true;
  }

  /// The values in the order of `less`; each then has its number.
  template <class Less>
  std::vector<U> sorted(const Less& less) {
    std::vector<U> all;
    for (std::size_t slot = 0; slot < kSlots; ++slot)
      if (used_[slot]) all.push_back(values_[slot]);
    std::sort(all.begin(), all.end(), less);
    for (std::size_t i = 0; i < all.size(); ++i)
      numbers_[find(all[i])] = static_cast<std::uint8_t>(i);
    return all;
  }
  std::uint8_t number_of(U value) const { return numbers_[find(value)]; }

 private:
  static constexpr std::size_t kSlots = 1024;

  static std::size_t slot_of(U value) {
    return static_cast<std::size_t>((std::uint64_t{value} * 0x9e3779b97f4a7c15u) >> 54);
  }
  std::size_t find(U value) const {
    std::size_t slot = slot_of(value);
    while (values_[slot] != value || !used_[slot]) slot = (slot + 1) % kSlots;
    return slot;
  }

  std::size_t count_ = 0;
  bool used_[kSlots] = {};
  U values_[kSlots] = {};
  std::uint8_t numbers_[kSlots] = {};
};

/// Whether numbers in place of the values make much smaller differences.
template <class T, class U>
bool has_gaps(const std::vector<U>& values) {
  const auto place = [](U value) {
    if constexpr (std::is_floating_point_v<T>)
      return std::uint64_t{ordered_of(value)};
    else
      return static_cast<std::uint64_t>(static_cast<std::int64_t>(static_cast<T>(value)));
  };
  return (place(values.back()) - place(values.front())) / 4 >= values.size();
}

template <class T>
std::optional<Palette> find(std::span<const std::byte> samples) {
  using U = Word<sizeof(T)>;
  const std::size_t count = samples.size() / sizeof(U);
  const auto at = [&](std::size_t i) {
    U value;
    std::memcpy(&value, samples.data() + i * sizeof(U), sizeof value);
    return value;
  };
  ValueTable<U> table;
  U before = static_cast<U>(~at(0));
  for (std::size_t i = 0; i < count; ++i) {
    const U value = at(i);
    if (value != before && !table.add(value)) return std::nullopt;
    before = value;
  }
  const auto less = [](U a, U b) {
    if constexpr (std::is_floating_point_v<T>)
      return ordered_of(a) < ordered_of(b);
    else
      return static_cast<T>(a) < static_cast<T>(b);
  };
  const std::vector<U> values = table.sorted(less);
  if (!has_gaps<T>(values)) return std::nullopt;
  Palette palette;
  palette.entries = values.size();
  palette.values.resize(values.size() * sizeof(U));
  std::memcpy(palette.values.data(), values.data(), palette.values.size());
  palette.numbers.resize(count);
  std::uint8_t number = table.number_of(at(0));
  for (std::size_t i = 0; i < count; ++i) {
    if (i > 0 && at(i) != at(i - 1)) number = table.number_of(at(i));
    palette.numbers[i] = std::byte{number};
  }
  return palette;
}

template <std::size_t bytes>
void look_up_words(std::span<const std::byte> values, std::span<const std::byte> numbers,
                   std::byte* samples) {
  using U = Word<bytes>;
  U all[kMaxPalette] = {};
  std::memcpy(all, values.data(), values.size());
  for (const std::byte number : numbers) {
    std::memcpy(samples, &all[std::to_integer<std::size_t>(number)], sizeof(U));
    samples += sizeof(U);
  }
}

}  // namespace

std::optional<Palette> find_palette(ScalarType type, std::span<const std::byte> samples) {
  return visit_sample(type, [&](auto tag) -> std::optional<Palette> {
    using T = typename decltype(tag)::type;
    if constexpr (sizeof(T) == 1)
      return std::nullopt;
    else
      return find<T>(samples);
  });
}

void look_up(std::span<const std::byte> values, std::size_t entries,
             std::span<const std::byte> numbers, std::byte* samples) {
  const auto largest = std::max_element(numbers.begin(), numbers.end());
  if (largest != numbers.end() && std::to_integer<std::size_t>(*largest) >= entries)
    throw DamageError("a sample's number is none of its palette");
  switch (values.size() / entries) {
    case 2: return look_up_words<2>(values, numbers, samples);
    case 4: return look_up_words<4>(values, numbers, samples);
    default: return look_up_words<8>(values, numbers, samples);
  }
}

}  // namespace isobrick::inline v0::packed
