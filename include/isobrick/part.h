#pragma once

#include <cstdint>

namespace isobrick::inline v0 {

/// Parts of an operation at most.
inline constexpr std::uint32_t kMaxParts = 1'000'000;

/// One of several parts of an operation, each the work of a task that knows nothing of the others.
/// All tasks divide the work alike.
struct Part {
  std::uint32_t number = 1;  ///< 1 to `count`
  std::uint32_t count = 1;   ///< parts altogether, at most kMaxParts

  friend bool operator==(const Part&, const Part&) = default;
};

}  // namespace isobrick
