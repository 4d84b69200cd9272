#pragma once

#include <optional>
#include <string>

#include <isobrick/error.h>
#include <isobrick/scalar.h>
#include <isobrick/surface_options.h>
#include "surface/coincident_vertices.h"

namespace isobrick::inline v0::gpu {

/// Why the kernels cannot make such a surface, in a line; nothing when they can.
inline std::optional<std::string> why_unsupported(const SurfaceOptions& options) {
  if (options.topology == Topology::trilinear && options.drop_degenerate)
    return "the topology of the trilinear interpolant has no kernels without degenerate triangles; "
           "use --backend cpu";
  if (options.cap) return "capped surfaces have no kernels; use --backend cpu";
  return std::nullopt;
}

/// Whether there may be degenerate triangles to leave out.
inline bool leaves_out_degenerate(ScalarType type, const SurfaceOptions& options) {
  return options.drop_degenerate && has_coincident(type, options.isovalue);
}

/// The options of a surface without what makes no difference for samples of the type. Buffers, the
/// search for bricks and kernels go by the same ones.
inline SurfaceOptions options_that_matter(ScalarType type, SurfaceOptions options) {
  options.may_have_nan = options.may_have_nan && is_floating(type);
  options.drop_degenerate = leaves_out_degenerate(type, options);
  return options;
}

/// Throws UsageError with that line.
inline void check_supported(const SurfaceOptions& options) {
  if (const auto why = why_unsupported(options)) throw UsageError(*why);
}

}  // namespace isobrick::gpu
