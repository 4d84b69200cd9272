#pragma once

#include <cstdint>

#include <isobrick/mesh_filters.h>
#include "tools/options.h"

// What `isobrick extract` does to meshes on their way to a file.
namespace isobrick::tools {

/// --min-component, --largest, --smooth, --pass-band, --simplify, --max-error, --mesh-unit and
/// --measure.
struct FilterArguments {
  std::uint64_t min_component = 0, largest = 0;  ///< 0: not given
  int smooth = 0;                                ///< 0: not given
  std::optional<double> pass_band;
  double simplify_ratio = 1;             ///< of the triangles
  std::uint64_t simplify_triangles = 0;  ///< 0: by the ratio
  double max_error = 0;                  ///< 0: not given
  std::string unit;                      ///< of the mesh; empty: the volume's
  bool measure = false;
};

void add_filters(CLI::App* app, FilterArguments& filters);

/// Sets what a 3-D print needs, where it is not given: the largest component, smooth and of 500,000
/// triangles.
void set_for_print(FilterArguments& filters);

/// Throws UsageError for options that contradict each other; `estimates`: nothing is written.
void check_filters(const FilterArguments& filters, bool estimates);

/// Memory and place are those of the caller.
MeshFilterOptions filter_options(const FilterArguments& filters);

}  // namespace isobrick::tools
