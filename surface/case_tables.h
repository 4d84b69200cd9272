#pragma once

#include "surface/case_rule.h"

namespace isobrick::inline v0 {

/// The tables that every extraction uses, for right- and for left-handed axes.
extern const CaseTables kCaseTables;
extern const CaseTables kMirroredCaseTables;

}  // namespace isobrick
