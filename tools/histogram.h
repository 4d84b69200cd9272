#pragma once

#include <string>

#include <isobrick/histogram.h>

namespace isobrick::tools {

/// The counts as columns of block characters, `rows` lines high, with the values
/// below, as samples of `type`. Heights are square roots, so that a background does not hide the
/// rest.
std::string draw(const Histogram& histogram, int rows, ScalarType type);

}  // namespace isobrick::tools
