#pragma once

#include <string>
#include <vector>

#include <isobrick/progress.h>
#include "io/meshes/readers/mesh_file.h"
#include "viewer/render/camera_request.h"
#include "viewer/render/renderer.h"

namespace isobrick::inline v0 {

struct MeshInput {
  std::string path;
  MeshStyle style;
};

/// A request for a picture of mesh files.
struct MeshPictureRequest {
  std::vector<MeshInput> meshes;
  int width = 1280, height = 960;
  CameraRequest camera;
  PictureSettings settings;
  bool box = false, axes = false, scale_bar = false;
  /// Unit of the scale bar, as unit_name() returns it. Empty: that of the meshes, if they have one.
  std::string scale_bar_unit;
};

struct MeshPicture {
  std::vector<std::uint8_t> rgba;  ///< rows from the top
  std::uint64_t vertices = 0, triangles = 0;
  Vec3d lo, hi;          ///< bounds of all meshes
  std::string unit;      ///< of all coordinates: the first unit of a mesh; or empty
  std::string renderer;  ///< OpenGL's renderer
};

/// Maximum bytes of memory while the picture is drawn, including OpenGL's driver. They depend on
/// the pixels and on a batch of triangles, not on the size of the meshes.
std::uint64_t mesh_picture_memory(const MeshPictureRequest& request);

/// Draws mesh files off-screen within mesh_picture_memory(). Meshes in another unit of length than
/// the first one's are scaled to it; those without a unit are taken to be in it. Throws UsageError
/// for a scale bar in a unit that the meshes lack, Error for a file without triangles, and what
/// open_mesh_file, GlContext and Renderer throw.
MeshPicture draw_mesh_files(const MeshPictureRequest& request, Progress& progress);

}  // namespace isobrick
