#pragma once

/// Marks what the shared library is for: all else in it is hidden.
#define ISOBRICK_API __attribute__((visibility("default")))
