#pragma once

#include <cstdint>
#include <vector>

#include "isobrick/core/vec.h"
#include "isobrick/meshes/preview_raster.h"

namespace isobrick {

/// The picture of what a raster holds, averaged over 2×2 points a pixel: sRGB,
/// 3 bytes a pixel, rows from the top. `colour`: of the surface, sRGB in [0, 1].
/// `pixel`: see PreviewCamera, of the raster's points.
std::vector<std::uint8_t> shade_preview(const PreviewRaster& raster, float pixel, Vec3f colour);

}  // namespace isobrick
