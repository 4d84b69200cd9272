#pragma once

#include <cstdint>
#include <vector>

#include <isobrick/synth_source.h>

namespace isobrick::inline v0 {

/// The labels of SynthKind::cells over one box, row by row. There is a seed at a random place in
/// each cube of a grid; a sample has the label of the nearest seed, counted from 1, or 0 where none
/// is near.
class SynthCells {
 public:
  /// `options.frequency` is set.
  SynthCells(const SynthOptions& options, Box3 box);

  /// The row (y, z), as many labels as the box is wide.
  void row(Index y, Index z, std::uint32_t* out);

  /// The largest label.
  static double max_label(const SynthOptions& options);

 private:
  /// A seed and how far it is from the row, squared.
  struct Candidate {
    float x, off_row;
    std::uint32_t label;
  };

  void find_candidates(Int3 cube, float y, float z);

  Box3 box_;
  std::uint64_t seed_;
  float edge_;  ///< of a cube, in samples
  Int3 grid_;
  std::vector<Candidate> candidates_;
};

}  // namespace isobrick
