#pragma once

// The version of these headers: compare with #if. CMake reads it here.

/// Changes where programs must change.
#define ISOBRICK_VERSION_MAJOR 0
/// Changes with new functions; below version 1 also where programs must change.
#define ISOBRICK_VERSION_MINOR 1
/// Changes with corrections.
#define ISOBRICK_VERSION_PATCH 0
/// All three as one number, such as 102 for 0.1.2.
#define ISOBRICK_VERSION \
  (ISOBRICK_VERSION_MAJOR * 10000 + ISOBRICK_VERSION_MINOR * 100 + ISOBRICK_VERSION_PATCH)
