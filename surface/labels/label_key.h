#pragma once

#include <cstdint>

#include <isobrick/label.h>
#include "core/flat_map.h"

namespace isobrick::inline v0 {

/// The key of a label in a FlatMap: its bits, which differ among the labels of an image.
struct LabelKey {
  std::uint64_t bits = 0;
  bool is_label = false;

  friend bool operator==(const LabelKey&, const LabelKey&) = default;
};

constexpr LabelKey label_key(const Label& label) { return {label.bits(), true}; }

template <>
struct FlatKey<LabelKey> {
  static constexpr LabelKey kFree{};
  static std::uint64_t number(const LabelKey& key) { return key.bits; }
};

}  // namespace isobrick
