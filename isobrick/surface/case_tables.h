#pragma once

#include "isobrick/surface/case_rule.h"

namespace isobrick {

/// The tables that every extraction uses.
extern const CaseTables kCaseTables;

}  // namespace isobrick
