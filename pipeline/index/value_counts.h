#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include <isobrick/lattice.h>
#include "bricks/ranges/stored_histogram.h"

namespace isobrick::inline v0 {

/// Counts samples by their values, in bins as narrow as a store keeps them (SampleCounts). The
/// result depends on nothing but the samples: not on their order, the calls or the threads.
class ValueCounts {
 public:
  virtual ~ValueCounts() = default;

  /// Counts the samples of `part`, which lies in `box`; `samples` is dense over `box`. Thread-safe.
  virtual void add(const std::byte* samples, Box3 box, Box3 part) = 0;
  /// Counts a value of the sample type so many times. Thread-safe.
  virtual void add(double value, std::uint64_t times) = 0;
  /// The counts so far; nobody adds meanwhile.
  virtual SampleCounts counts() = 0;
};

std::unique_ptr<ValueCounts> make_value_counts(ScalarType type);

/// Adds counts as if their samples had been counted. A wider bin holds whole bins of narrower ones,
/// so any value of a bin stands for all; the smallest and the largest sample stand for themselves.
void add_counts(const SampleCounts& from, ValueCounts& to);

/// Bytes that the ValueCounts of a type take at most while so many threads add to them.
std::size_t value_counts_bytes(ScalarType type, int threads);

}  // namespace isobrick
