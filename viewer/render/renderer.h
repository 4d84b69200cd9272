#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <isobrick/vec.h>
#include "core/half_space.h"
#include "viewer/render/camera.h"
#include "viewer/render/mesh_pool.h"

namespace isobrick::inline v0 {

/// An axis-aligned box in world space.
struct WorldBox {
  Vec3d lo, hi;
};

/// Settings of a picture. Colours are sRGB in [0, 1].
struct PictureSettings {
  Vec3f background_top{0.95f, 0.96f, 0.97f}, background_bottom{0.74f, 0.77f, 0.80f};
  bool multisample = true;  ///< four samples per pixel
  bool occlusion = true;    ///< screen-space ambient occlusion
  bool edges = false;       ///< dark lines at steps of depth or normal
  bool picking = false;     ///< keep each pixel's mesh id
  /// copy_to() draws lines, axes and the scale bar at the size of its target, because the picture
  /// is smaller than the target. The picture itself has none.
  bool defer_overlays = false;
  /// Scale of the display: the thickness of lines is multiplied by it, and so is the minimum size
  /// of text and axes.
  float overlay_scale = 1;
  /// Draws meshes in the order of draw(). The order shows where two meshes have equal depth, and in
  /// the last bits of transparent ones. Without it, meshes of one pool block take one call.
  bool in_order = true;
  std::vector<HalfSpace> planes;   ///< clip planes: what lies within all of them is drawn
  std::optional<WorldBox> region;  ///< clip box; it counts as 6 of at most 12 planes

  /// The half spaces of the planes, then those of the region.
  std::vector<HalfSpace> half_spaces() const;
};

struct MeshStyle {
  Vec3f colour{0.87f, 0.80f, 0.70f};
  float opacity = 1;  ///< seen face to face; below 1: transparent
  /// Colour of back faces in a clipped picture; nullopt: a darker tone.
  std::optional<Vec3f> inside = {};
  bool vertex_colours = true;  ///< a mesh's vertex colours override `colour`
  /// The id that pick() returns; 0: none. Transparent meshes keep the lowest 8 bits.
  std::uint32_t id = 0;
  /// Mask of the picture's half spaces that may clip the mesh; 0 is the fastest.
  std::uint16_t clip_mask = 0xffff;
  friend bool operator==(const MeshStyle&, const MeshStyle&) = default;
};

/// A rectangular image in world space.
struct SliceImage {
  Vec3d corner, along_x, along_y;       ///< world space: first corner and the two edges
  int width = 0, height = 0;            ///< extent in samples, x fastest
  std::span<const float> samples;       ///< NaN: not drawn
  float window_lo = 0, window_hi = 1;   ///< values of the map's first and last colour
  std::span<const Vec3f> colours = {};  ///< colour map, sRGB; empty: grey
  float opacity = 1;
};

/// A line segment in world space.
struct WorldLine {
  Vec3d from, to;
};

/// What a pixel shows.
struct PickResult {
  Vec3d position;        ///< world space, on the nearest surface, opaque or transparent
  std::uint32_t id = 0;  ///< MeshStyle::id; 0 for others, and without PictureSettings::picking
};

/// Draws meshes into an off-screen picture, in any context: that of a window or a GlContext. For
/// one thread; the context it was made in must be current for every call. Each call leaves the
/// framebuffer, program, vertex array, viewport and switches at OpenGL's defaults.
///
/// Transparency uses weighted blending (McGuire and Bavoil 2013): one pass in any order, so that
/// meshes need not be kept. Depth peeling would be exact, but needs all meshes once for each layer.
class Renderer {
 public:
  /// Throws Error if the current context is older than OpenGL 4.5.
  Renderer();
  ~Renderer();

  /// Device memory while a picture of this size is drawn. `transparent`: with transparent meshes.
  /// Not included: the samples of the other multisampling mode, if both are in use, and the
  /// previous picture while a new one is drawn in batches.
  static std::uint64_t memory(int width, int height, const PictureSettings& settings,
                              bool transparent);

  /// Host memory of OpenGL besides pictures and meshes, with `renderers` renderers at a time: the
  /// driver's libraries once, and for each renderer its shaders and what a software driver keeps of
  /// queued meshes.
  static std::uint64_t driver_memory(int renderers = 1);

  /// Draws a triangle with these settings and this size, clipped and unclipped. Drivers compile
  /// shaders and allocate memory at the first use; later pictures then need not wait for that.
  void prepare(const PictureSettings& settings, int width, int height);

  /// Starts a picture and drops an unfinished one. Throws UsageError for an invalid size or too
  /// many planes.
  void begin(const Camera& camera, int width, int height, const PictureSettings& settings);

  /// Draws a mesh at end(). The mesh must live until the picture is finished or dropped.
  void draw(const PooledMesh& mesh, const MeshStyle& style);
  /// Draws a mesh now and does not keep it; triangles index from its first vertex. Draw opaque
  /// meshes before transparent ones.
  void draw(const MeshChunk& mesh, const MeshStyle& style, Vec3d origin = {});
  /// Draws a slice at end(); copies its samples now.
  void draw(const SliceImage& slice);

  // Overlays, drawn on top of the finished picture at end().

  /// Draws lines `width` pixels thick, faint where a surface hides them.
  void draw_lines(std::span<const WorldLine> lines, Vec3f colour, float width = 1.5f);
  void draw_box(Vec3d lo, Vec3d hi, Vec3f colour, float width = 1.5f);
  /// Draws the world's axes x (red), y (green) and z (blue) in the lower left corner.
  void draw_axes();
  /// Draws a scale bar in the lower right corner: a round length at the target's depth, such as "20
  /// mm". `unit` may be empty; it is `unit_length` long in the world.
  void draw_scale_bar(const std::string& unit, double unit_length = 1);

  /// Finishes the picture.
  void end();
  /// Does about `work` (at least 1) more of what end() does. Returns true once the picture is
  /// finished; it has the same bytes. Until then the previous picture stays, and the functions
  /// below refer to it. Other code may draw in the context between calls. Work is counted in
  /// triangles; a step over the whole picture counts as many as take the same time in software.
  bool advance(std::uint64_t work);
  /// Work that end() would do.
  std::uint64_t work_left() const;

  /// Drops the finished picture; the next one reuses its memory.
  void discard();
  /// Whether there is a finished picture. Without one the functions below return nothing and do
  /// nothing.
  bool has_picture() const;

  int width() const;
  int height() const;
  /// Returns the picture: RGBA, 4 bytes per pixel, sRGB, rows from the top.
  std::vector<std::uint8_t> read_pixels() const;
  /// Its texture (GL_RGBA8, sRGB-encoded, rows from the bottom), for example for ImGui::Image.
  unsigned texture() const;
  /// Copies it into a framebuffer (0: the window's), scaled to this size, with its lower left
  /// corner at (left, 0); see PictureSettings::defer_overlays.
  void copy_to(unsigned framebuffer, int to_width, int to_height, int left = 0) const;

  /// What the picture shows at pixel (x, y), rows from the top; nullopt on the background.
  std::optional<PickResult> pick(int x, int y) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Converts RGBA pixels to RGB, as write_png takes them.
std::vector<std::uint8_t> without_alpha(std::vector<std::uint8_t> rgba);

}  // namespace isobrick
