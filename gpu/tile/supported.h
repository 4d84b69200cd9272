#pragma once

#include <optional>
#include <string>

#include <isobrick/error.h>
#include <isobrick/surface_options.h>
#include "gpu/memory/device_scalar.h"

namespace isobrick::gpu {

/// Why the kernels cannot make such a surface, in a line; nothing when they can.
inline std::optional<std::string> why_unsupported(ScalarType type, const SurfaceOptions& options) {
  if (!is_device_scalar(type))
    return "samples of type " + std::string(short_name(type)) +
           " have no CUDA kernels; use --backend cpu";
  if (options.drop_degenerate)
    return "degenerate triangles cannot be left out on a GPU; use --backend cpu";
  return std::nullopt;
}

/// Throws UsageError with that line.
inline void check_supported(ScalarType type, const SurfaceOptions& options) {
  if (const auto why = why_unsupported(type, options)) throw UsageError(*why);
}

}  // namespace isobrick::gpu
