#pragma once

#include "tools/input.h"

namespace isobrick::tools {

/// Writes what the headers of a volume that is no store say. Reads no sample.
void report_source(const InputArguments& input, Console& console);

}  // namespace isobrick::tools
