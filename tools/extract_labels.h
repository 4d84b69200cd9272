#pragma once

#include <string>
#include <vector>

#include <isobrick/labels.h>
#include "tools/console.h"
#include "tools/extract_plan.h"

// `isobrick extract --labels`: a mesh of every label instead of isosurfaces.

namespace isobrick::tools {

/// "all" (nothing), or labels and ranges of them: "3,7,10:20".
std::vector<LabelRange> parse_labels(const std::string& text);

/// What `extract` does where labels are requested.
int run_extract_labels(const ExtractArguments& arguments, Console& console);

}  // namespace isobrick::tools
