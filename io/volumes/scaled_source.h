#pragma once

#include <memory>
#include <optional>
#include <span>

#include <isobrick/volume_source.h>

namespace isobrick::inline v0 {

/// From stored to real values: slope · stored + intercept.
struct ValueScale {
  double slope = 1, intercept = 0;

  friend bool operator==(const ValueScale&, const ValueScale&) = default;
  bool identity() const { return slope == 1 && intercept == 0; }
};

/// The real values of `stored`: computed in f64 and rounded to f32, or f64 where
/// those are stored. A scale that changes nothing leaves the source, and its
/// type, as they are.
std::unique_ptr<VolumeSource> scale_source(std::unique_ptr<VolumeSource> stored, ValueScale scale);

/// Turns `count` stored samples, which are the last ones of the room that scaled samples take at
/// `out`, into scaled ones. These have no fewer bytes.
void scale_in_place(ScalarType stored, ScalarType scaled, std::size_t count, ValueScale scale,
                    std::byte* out);

/// What scaled samples of a stored type are.
constexpr ScalarType scaled_type(ScalarType stored) {
  return size_of(stored) == 8 ? ScalarType::f64 : ScalarType::f32;
}

/// The smallest integer type, of no fewer bytes than `stored`, that holds what any of the scales
/// makes of the integers `lo` to `hi`; nothing where a scale makes fractions or no type is enough.
std::optional<ScalarType> integer_scaled_type(ScalarType stored, double lo, double hi,
                                              std::span<const ValueScale> scales);

}  // namespace isobrick
