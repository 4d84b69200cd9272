#pragma once

#include <cstdint>

namespace isobrick::inline v0 {

inline constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;

/// What the program, its libraries, their stacks and small tables take of a memory budget: 12 MiB
/// were measured of commands on a volume of a few samples.
inline constexpr std::uint64_t kProgramBytes = std::uint64_t{20} << 20;

// Budgets in messages: bytes as MiB, and the least whole number of MiB that is enough.
inline double in_mib(std::uint64_t bytes) {
  return static_cast<double>(bytes) / static_cast<double>(kMiB);
}
inline std::uint64_t mib_above(std::uint64_t bytes) { return bytes / kMiB + 1; }

}  // namespace isobrick
