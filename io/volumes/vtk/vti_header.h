#pragma once

#include <string>

#include <isobrick/array_view.h>
#include <isobrick/scalar.h>
#include <isobrick/selection.h>
#include <isobrick/transform.h>
#include "io/vtk/vtk_arrays.h"
#include "io/vtk/vtk_file.h"

namespace isobrick::inline v0 {

/// Describes one array of a VTK image file (`.vti`).
struct VtiHeader {
  ArrayView view;
  ScalarType type;
  Transform transform;
  VtkArrayLayout array;
};

VtkFile vti_file(const std::string& path);

/// Reads a file until its array `array` is found. An empty name means the array that is marked as
/// the scalars, or the only one. Point data go before cell data, whose samples lie at the centres
/// of cells. Throws UsageError for what is no such file and for what is not supported.
VtiHeader parse_vti_header(const VtkFile& file, const std::string& array,
                           const Selection& selection);

}  // namespace isobrick
