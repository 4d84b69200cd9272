#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <isobrick/scalar.h>

namespace isobrick::inline v0::packed {

/// The different values of a brick, in ascending order, and each sample's number among them.
struct Palette {
  std::size_t entries = 0;
  std::vector<std::byte> values, numbers;
};

/// Nothing for samples of one byte, where there are more than kMaxPalette values, and where most
/// lie so close together that their numbers would be no shorter.
std::optional<Palette> find_palette(ScalarType type, std::span<const std::byte> samples);

/// The values of so many numbers. Throws DamageError for one that `entries` values lack.
void look_up(std::span<const std::byte> values, std::size_t entries,
             std::span<const std::byte> numbers, std::byte* samples);

}  // namespace isobrick::inline v0::packed
