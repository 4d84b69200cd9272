#pragma once

#include <optional>
#include <string_view>

#include <isobrick/scalar.h>
#include <isobrick/vec.h>

namespace isobrick::inline v0 {

/// The description of samples in a file's name.
struct RawName {
  std::optional<Int3> extent;
  std::optional<ScalarType> type;
};

/// Finds `256x256x128` and `uint8` (or `u8`, `uchar`, `float`, …) among the
/// words of a stem; words end at `_`, `-`, `.` and blanks, case does not matter.
/// The last extent counts, and the type closest after it, else any.
/// Numbers too large for an Index are taken for their largest value, so that
/// they are refused as extents later and not overlooked here.
RawName parse_raw_name(std::string_view stem);

}  // namespace isobrick
