#pragma once

#include <cstdint>
#include <filesystem>
#include <stop_token>

#include <isobrick/api.h>
#include <isobrick/index_build.h>
#include <isobrick/lattice.h>
#include <isobrick/progress.h>
#include <isobrick/selection.h>

namespace isobrick::inline v0 {

/// How lists of labels are added to a store; as in IndexOptions.
struct LabelIndexOptions {
  Selection selection = {};                       ///< of an image with several channels or times
  std::uint64_t memory = std::uint64_t{1} << 30;  ///< hard budget, bytes
  int threads = 0;                                ///< 0: all cores
  bool resume = false;                            ///< go on with an interrupted build
  bool force = false;                             ///< replace the index that is there
  std::stop_token cancel = {};                    ///< ends the operation with Cancelled
};

/// Throws UsageError for a budget that is too small for lists of a level of this lattice, of which
/// `others` bytes are in use already.
ISOBRICK_API void check_label_index_options(const LabelIndexOptions& options,
                                            const Lattice& lattice, std::uint64_t others = 0);

/// Adds to all levels of a label image lists of the labels that are in 64³ and in 32³ cells.
/// extract_labels() of some labels then reads the bricks that these lie in, where ranges only tell
/// that a label may be between two others. The meshes are the same. Ranges that the store lacks are
/// computed first. Throws as add_index() does, and Error where a sample is no label.
ISOBRICK_API IndexReport add_label_index(const std::filesystem::path& store,
                                         const LabelIndexOptions& options,
                                         Progress& progress = no_progress());

}  // namespace isobrick
