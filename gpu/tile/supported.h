#pragma once

#include <optional>
#include <string>

#include <isobrick/error.h>
#include <isobrick/surface_options.h>

namespace isobrick::inline v0::gpu {

/// Why the kernels cannot make such a surface, in a line; nothing when they can.
inline std::optional<std::string> why_unsupported(const SurfaceOptions& options) {
  if (options.drop_degenerate)
    return "degenerate triangles cannot be left out on a GPU; use --backend cpu";
  if (options.topology == Topology::trilinear)
    return "the topology of the trilinear interpolant has no kernels; use --backend cpu";
  if (options.cap) return "capped surfaces have no kernels; use --backend cpu";
  return std::nullopt;
}

/// Throws UsageError with that line.
inline void check_supported(const SurfaceOptions& options) {
  if (const auto why = why_unsupported(options)) throw UsageError(*why);
}

}  // namespace isobrick::gpu
