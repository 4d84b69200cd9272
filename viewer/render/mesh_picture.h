#pragma once

#include <string>
#include <vector>

#include <isobrick/progress.h>
#include "io/meshes/readers/mesh_file.h"
#include "viewer/render/camera_request.h"
#include "viewer/render/renderer.h"

namespace isobrick {

/// A mesh file in a picture.
struct MeshInput {
  std::string path;
  MeshStyle style;
};

/// A picture of mesh files.
struct MeshPictureRequest {
  std::vector<MeshInput> meshes;
  int width = 1280, height = 960;
  CameraRequest camera;
  PictureSettings settings;
  bool box = false, axes = false, scale_bar = false;
  /// Of the scale bar, as unit_name() has it. Empty: that of the meshes, or none where they have
  /// none.
  std::string scale_bar_unit;
};

struct MeshPicture {
  std::vector<std::uint8_t> rgba;  ///< rows from the top
  std::uint64_t vertices = 0, triangles = 0;
  Vec3d lo, hi;          ///< bounds of all meshes
  std::string unit;      ///< of all coordinates: that of the first mesh that has one, or empty
  std::string renderer;  ///< what drew it
};

/// Bytes that the picture takes while it is drawn, OpenGL's driver among them, until it is written:
/// those of its pixels and of a batch of triangles, however large the meshes are.
std::uint64_t mesh_picture_memory(const MeshPictureRequest& request);

/// Draws mesh files off-screen; memory is that of mesh_picture_memory().
/// Meshes of another unit of length than the first one's are scaled to it; those without a unit
/// are taken to be in it. Throws UsageError for a scale bar in a unit that the meshes lack, Error
/// for a file without triangles, and as open_mesh_file, GlContext and Renderer do.
MeshPicture draw_mesh_files(const MeshPictureRequest& request, Progress& progress);

}  // namespace isobrick
