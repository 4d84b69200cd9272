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

namespace isobrick {

/// A box of world space, axis by axis.
struct WorldBox {
  Vec3d lo, hi;
};

/// How a picture is made. Colours are sRGB in [0, 1].
struct PictureSettings {
  Vec3f background_top{0.95f, 0.96f, 0.97f}, background_bottom{0.74f, 0.77f, 0.80f};
  bool multisample = true;  ///< four samples a pixel
  bool occlusion = true;    ///< less light where the surroundings are near
  bool edges = false;       ///< dark lines where depth or direction break off
  bool picking = false;     ///< keep which mesh each pixel shows
  /// Lines, axes and the scale bar are drawn where the picture is copied to, and at that size: it
  /// is smaller than what it is shown in. The picture itself has none then.
  bool defer_overlays = false;
  /// Of a display that is scaled: lines are so many times as thick, text and axes at least so many
  /// times the smallest that can be read.
  float overlay_scale = 1;
  /// Meshes are drawn as they come. It shows at pixels where two are equally far, and of
  /// transparent ones in the last bits. Without, those that lie together in memory take one call.
  bool in_order = true;
  std::vector<HalfSpace> planes;   ///< what lies within all of them is drawn
  std::optional<WorldBox> region;  ///< and within this box, which counts as 6 planes of at most 12

  /// Those of the planes, then those of the region.
  std::vector<HalfSpace> half_spaces() const;
};

/// How a mesh is drawn.
struct MeshStyle {
  Vec3f colour{0.87f, 0.80f, 0.70f};
  float opacity = 1;                 ///< of a piece seen face to face; below 1: transparent
  std::optional<Vec3f> inside = {};  ///< of the back where something is cut off; else a darker tone
  bool vertex_colours = true;        ///< where the mesh has them they go before `colour`
  /// What pick() tells; 0: nothing. Of transparent ones the lowest 8 bits.
  std::uint32_t id = 0;
  /// Of the picture's half spaces those that may cut it, a bit each: with none it is drawn sooner.
  std::uint16_t clip_mask = 0xffff;
  friend bool operator==(const MeshStyle&, const MeshStyle&) = default;
};

/// A plane picture in space: samples from corner to corner.
struct SliceImage {
  Vec3d corner, along_x, along_y;  ///< world space: the picture's first corner and its two edges
  int width = 0, height = 0;       ///< samples, x fastest
  std::span<const float> samples;  ///< NaN: nothing there
  float window_lo = 0, window_hi = 1;   ///< what becomes the map's first and last colour
  std::span<const Vec3f> colours = {};  ///< map, sRGB; empty: grey
  float opacity = 1;
};

/// A segment of world space.
struct WorldLine {
  Vec3d from, to;
};

/// What is under a pixel.
struct PickResult {
  Vec3d position;        ///< world space, of the nearest surface, transparent meshes among them
  std::uint32_t id = 0;  ///< of its MeshStyle; 0 for others, and without PictureSettings::picking
};

/// Draws meshes into a picture of its own, in whatever context is current: that of a
/// window or a GlContext. One thread; the context that it was made in must be
/// current for every call. It leaves that context's framebuffer, program, vertex
/// array, viewport and switches at OpenGL's defaults.
///
/// Transparency is weighted and blended (McGuire and Bavoil 2013): one pass, any
/// order, which is what meshes need that pass by once and are not kept. Peeling would be exact
/// where several surfaces lie behind each other, but would need them all once a layer.
class Renderer {
 public:
  /// Throws Error when the current context is older than OpenGL 4.5.
  Renderer();
  ~Renderer();

  /// Device memory of a picture of this size while it is made. With transparent meshes: more;
  /// where pictures of one size are made with and without multisampling, the samples of both are
  /// kept; and where one is drawn in pieces, what the one before has become.
  static std::uint64_t memory(int width, int height, const PictureSettings& settings,
                              bool transparent);

  /// What OpenGL takes of the host's memory beside pictures and meshes, with so many renderers at a
  /// time: the driver's libraries once, and for each renderer its compiled shaders and what a
  /// software driver keeps of the meshes that it is drawing.
  static std::uint64_t driver_memory(int renderers = 1);

  /// Draws a triangle as pictures of this size and with these settings are drawn, cut or not:
  /// drivers compile shaders, and get memory, when something is first drawn, and no picture waits
  /// for that any more.
  void prepare(const PictureSettings& settings, int width, int height);

  /// Starts a picture; one that is not finished is dropped. Throws UsageError for a size that
  /// cannot be.
  void begin(const Camera& camera, int width, int height, const PictureSettings& settings);

  /// Draws a mesh at end(); it must live until the picture is finished or the next one begins.
  void draw(const PooledMesh& mesh, const MeshStyle& style);
  /// Draws a mesh now, without keeping it; numbers count from its first vertex.
  /// Opaque ones before transparent ones.
  void draw(const MeshChunk& mesh, const MeshStyle& style, Vec3d origin = {});
  /// Draws a slice at end(); copies its samples now.
  void draw(const SliceImage& slice);

  // On top of the finished picture, at end().

  /// Lines `width` pixels thick, faint where a surface hides them.
  void draw_lines(std::span<const WorldLine> lines, Vec3f colour, float width = 1.5f);
  void draw_box(Vec3d lo, Vec3d hi, Vec3f colour, float width = 1.5f);
  /// The world's axes x (red), y (green) and z (blue) in the lower left corner.
  void draw_axes();
  /// A bar of a round length at the target's depth in the lower right corner, such as
  /// "20 mm". `unit` may be empty; it is `unit_length` long in the world.
  void draw_scale_bar(const std::string& unit, double unit_length = 1);

  /// Finishes the picture.
  void end();
  /// Does about `work`, at least 1, more of what end() does. True once the picture is finished,
  /// which then is the same bytes; until then the one before stays whole, for all functions below.
  /// Other drawing in the context may come in between. Work is counted in triangles; a step over
  /// the whole picture counts as many as take as long in software.
  bool advance(std::uint64_t work);
  /// What end() would have to do.
  std::uint64_t work_left() const;

  /// Forgets the finished picture; its memory is for the next one.
  void discard();
  /// Whether one has been finished since. Without one the functions below give and do nothing.
  bool has_picture() const;

  int width() const;
  int height() const;
  /// The picture: RGBA, 4 bytes a pixel, sRGB, rows from the top.
  std::vector<std::uint8_t> read_pixels() const;
  /// Its texture (GL_RGBA8, sRGB-encoded, rows from the bottom), for ImGui::Image say.
  unsigned texture() const;
  /// Copies it into a framebuffer (0: the window's), lower left corner at (left, 0), enlarged or
  /// reduced to this size; see PictureSettings::defer_overlays.
  void copy_to(unsigned framebuffer, int to_width, int to_height, int left = 0) const;

  /// What the picture shows at pixel (x, y), rows from the top; nothing on the background.
  std::optional<PickResult> pick(int x, int y) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The colours of RGBA pixels alone, as write_png takes them.
std::vector<std::uint8_t> without_alpha(std::vector<std::uint8_t> rgba);

}  // namespace isobrick
