#pragma once

#include <isobrick/scalar.h>
#include <isobrick/surface_options.h>
#include "core/threshold.h"
#include "gpu/tile/on_samples_params.h"
#include "surface/cap.h"
#include "surface/coincident_vertices.h"
#include "surface/world_map.h"

namespace isobrick::inline v0::gpu {

/// The options of a surface without what makes no difference for samples of the type. Buffers, the
/// search for bricks and kernels go by the same ones.
inline SurfaceOptions options_that_matter(ScalarType type, SurfaceOptions options) {
  options.may_have_nan = options.may_have_nan && is_floating(type);
  options.drop_degenerate = options.drop_degenerate && has_coincident(type, options.isovalue);
  return options;
}

/// Whether a mesh has vertices on samples.
inline bool has_samples(const SurfaceOptions& options) {
  return options.drop_degenerate || options.cap;
}

/// The parameters of a surface with vertices on samples, but for their memory.
inline SampleParams sample_params(ScalarType type, const SurfaceOptions& options) {
  SampleParams p{};
  p.drop = options.drop_degenerate && has_coincident(type, options.isovalue);
  p.cap = options.cap;
  p.below = options.inside == Inside::below;
  p.may_have_nan = options.may_have_nan && is_floating(type);
  p.none_reaches = visit_scalar(type, [&](auto tag) {
    return Threshold<typename decltype(tag)::type>(options.isovalue).none;
  });
  p.normals = axis_normals(world_map(options.transform, options.inside), options.inside);
  return p;
}

}  // namespace isobrick::gpu
