#pragma once

#include <string>
#include <vector>

#include "isobrick/core/progress.h"
#include "isobrick/render/camera_request.h"
#include "isobrick/render/mesh_file.h"
#include "isobrick/render/renderer.h"

namespace isobrick {

/// A mesh file in a picture.
struct PicturedMesh {
  std::string path;
  MeshStyle style;
};

/// A picture of mesh files.
struct MeshPictureRequest {
  std::vector<PicturedMesh> meshes;
  int width = 1280, height = 960;
  CameraRequest camera;
  PictureSettings settings;
  bool box = false, axes = false, scale_bar = false;
  std::string unit;  ///< of the scale bar
};

struct MeshPicture {
  std::vector<std::uint8_t> rgba;  ///< rows from the top
  std::uint64_t vertices = 0, triangles = 0;
  Vec3d lo, hi;          ///< bounds of all meshes
  std::string renderer;  ///< what drew it
};

/// Draws mesh files off-screen; memory is that of the picture and of a batch of triangles.
/// Throws Error for a file without triangles, and as open_mesh_file, GlContext and Renderer do.
MeshPicture draw_mesh_files(const MeshPictureRequest& request, Progress& progress);

}  // namespace isobrick
