#pragma once

#include <memory>

#include <isobrick/synth_source.h>

namespace isobrick::inline v0 {

/// A field in about [−1, 1] over one box, row by row; what is shared by rows
/// was computed once. `Real` is float or double.
template <class Real>
class SynthField {
 public:
  virtual ~SynthField() = default;
  /// The row (y, z), as many values as the box is wide.
  virtual void row(Index y, Index z, Real* out) = 0;
};

/// `options.frequency` is set; not for SynthKind::cells, which is no field (SynthCells).
template <class Real>
std::unique_ptr<SynthField<Real>> make_synth_field(const SynthOptions& options, Box3 box);

}  // namespace isobrick
