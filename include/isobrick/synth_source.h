#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>

#include <isobrick/api.h>
#include <isobrick/volume_source.h>

namespace isobrick::inline v0 {

/// The fields that can be computed.
enum class SynthKind : std::uint8_t {
  sphere,          ///< a ball of 0.4 times the shortest edge with a soft rim
  gyroid,          ///< the triply periodic surface, with white noise on top
  marschner_lobb,  ///< the test signal of Marschner and Lobb (f_M = 6, α = ¼)
  mixing,          ///< two fluids, layered along z, that mix in turbulence at mid-height
  cells,           ///< a label image: cells with gaps between them, numbered from 1
};

/// Its name on the command line: "sphere", "gyroid", "marschner-lobb", "mixing", "cells".
ISOBRICK_API std::string_view name_of(SynthKind kind);
/// The kind of this name; nullopt for any other.
ISOBRICK_API std::optional<SynthKind> parse_synth_kind(std::string_view name);

/// A volume made by computation.
struct SynthOptions {
  SynthKind kind = SynthKind::gyroid;  ///< the field
  Int3 extent{256, 256, 256};          ///< samples along x, y, z
  ScalarType type = ScalarType::u8;    ///< of the samples
  std::uint64_t seed = 1;              ///< of all that is random
  /// gyroid: periods along the longest edge; of N cells along that edge about
  /// 4.6 · frequency / N are active (2 at 512³: 1.8 %).
  /// mixing: largest eddies along the longest edge. cells: cells along it. Nothing: 2, 6 and 5.
  std::optional<double> frequency = {};
  /// gyroid: amplitude of the noise, as a part of the field's.
  double noise = 0.01;
};

/// The isovalue in the middle of every kind's field, where all of them have an
/// obvious surface, but cells. A field in [−1, 1] fills the type: floating samples are the
/// field itself (isovalue 0); unsigned ones reach from 0 to their maximum
/// (127.5 for u8), signed ones from their minimum to their maximum (−0.5). The
/// isovalue lies between two integers, so that no sample equals it.
ISOBRICK_API double default_isovalue(ScalarType type);

/// Samples are the same on every machine, whatever the boxes they are read by;
/// random access from any thread. Throws UsageError for options that make no sense.
ISOBRICK_API std::unique_ptr<VolumeSource> make_synth(const SynthOptions& options);

}  // namespace isobrick
