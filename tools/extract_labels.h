#pragma once

#include <string>
#include <vector>

#include <isobrick/labels.h>
#include "ranks/ranks.h"
#include "tools/console.h"
#include "tools/extract_plan.h"
#include "tools/label_writer.h"

// `isobrick extract --labels`: a mesh of every label instead of isosurfaces.

namespace isobrick::tools {

/// "all" (nothing), or labels and ranges of them: "3,7,10:20".
std::vector<LabelRange> parse_labels(const std::string& text);

/// What `extract` does where labels are requested.
int run_extract_labels(const ExtractArguments& arguments, Console& console);

/// With --part: a piece of the labels.
int run_extract_label_part(const ExtractArguments& arguments, Console& console);

/// Throws UsageError for options that say how an isosurface is made.
void check_label_arguments(const ExtractArguments& arguments);
LabelOptions label_options(const ExtractArguments& arguments, const StoreReader& store);

/// What is made by way of pieces.
struct LabelsByPieces {
  WrittenLabels written;  ///< of a job on its first rank
  std::uint64_t total = 0, kept = 0;
};

/// Makes the folder by way of pieces in another one beside it, which goes once the folder is there:
/// for --resume, and for the ranks of a job, where `job` is not null.
LabelsByPieces make_labels_by_pieces(const LabelOutput& output, const LabelListing& listing,
                                     const StoreReader& store, const LabelOptions& options,
                                     Ranks* job, Console& console);

}  // namespace isobrick::tools
