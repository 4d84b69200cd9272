#pragma once

#include <string>

#include <isobrick/index_build.h>
#include <isobrick/index_choice.h>
#include "tools/options.h"

namespace isobrick::tools {

/// "interval", "kdtree", "quadtree" or "octree".
IndexKind parse_stored_kind(const std::string& text);

/// "auto", "none" or a kind.
IndexChoice parse_index_choice(const std::string& text);

void add_leaf(CLI::App* app, Index& leaf);

}  // namespace isobrick::tools
