#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include <isobrick/scalar.h>
#include "surface/tile_samples.h"

namespace isobrick::inline v0 {

/// Samples of a box in memory: where the first one is, and bytes from one to the next along x, y,
/// z.
struct SampleArray {
  const std::byte* first = nullptr;
  Box3 box;
  Int3 strides;
  ScalarType type = ScalarType::u8;

  const std::byte* at(Int3 p) const { return first + dot(p - box.lo, strides); }
};

/// Which samples are missing: those of a value, and those where a mask is 0.
struct MissingSamples {
  std::optional<double> nodata;
  const std::uint8_t* mask = nullptr;  ///< of sample (0, 0, 0) of the volume
  Int3 mask_strides;                   ///< bytes

  bool any() const { return nodata || mask; }
};

/// What samples are for.
enum class SampleUse : std::uint8_t {
  surfaces,  ///< 64-bit integers are given as f64; one that no f64 is throws Error
  labels     ///< samples are given as they are, as far as none is missing
};

/// The samples of a volume of which an array holds all, or those that its users need. Missing ones
/// are NaN, in a type that has it. Owns nothing. Thread-safe.
class ArraySamples final : public TileSamples {
 public:
  ArraySamples(Int3 extent, const SampleArray& array, const MissingSamples& missing, SampleUse use);

  /// The type of the samples that are given.
  static ScalarType type_of(ScalarType stored, const MissingSamples& missing, SampleUse use);
  /// Of the samples that it gives. The brick is of no matter.
  const Lattice& lattice() const { return lattice_; }
  void gather(const TileWork& work, Index reach, const TileBlock& block) const override;
  /// Copies the samples of a box that the array holds to `to`, C order [z, y, x] without gaps.
  void copy(Box3 box, std::byte* to) const;

  /// The axes x, y, z from the one whose samples are nearest to each other to the farthest.
  const std::array<int, 3>& axes() const { return axes_; }
  /// The array, where it can be read as one of samples of the lattice's type that lie next to each
  /// other along axes()[0]; else null.
  const SampleArray* in_place() const { return in_place_ ? &array_ : nullptr; }

 private:
  void copy(Box3 box, std::byte* to, Index row, Index plane) const;

  SampleArray array_;
  MissingSamples missing_;
  Lattice lattice_;
  std::array<int, 3> axes_;
  bool in_place_;
};

}  // namespace isobrick
