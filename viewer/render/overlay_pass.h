#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "viewer/render/camera.h"
#include "viewer/render/font_atlas.h"
#include "viewer/render/gl_objects.h"
#include "viewer/render/picture_targets.h"
#include "viewer/render/renderer.h"

namespace isobrick {

/// What lies on top of a picture.
struct Overlays {
  struct Line {
    WorldLine line;
    Vec3f colour;
    float width;  ///< pixels
  };
  struct ScaleBar {
    std::string unit;
    double unit_length = 1;  ///< in the world
  };
  std::vector<Line> lines;
  bool axes = false;                  ///< of the world, in the lower left corner
  std::optional<ScaleBar> scale_bar;  ///< a round length in the lower right corner
  float scale = 1;                    ///< PictureSettings::overlay_scale

  bool empty() const { return lines.empty() && !axes && !scale_bar; }
};

/// Lines and text on top of a finished picture.
class OverlayPass {
 public:
  OverlayPass();

  /// Draws them into a part of a framebuffer of that size, `left` pixels from its left side, which
  /// shows what `camera` sees; faint behind what `near_depth` has, of a picture of any size. Its
  /// frame is bound.
  void run(const Overlays& overlays, const Camera& camera, unsigned framebuffer, int width,
           int height, const GlTexture& near_depth, int left = 0);

 private:
  void add_line(const WorldLine& line, Vec3f colour, float width);
  /// From pixel to pixel, always seen.
  void add_flat_line(Vec3d from, Vec3d to, Vec3f colour, float width);
  void add_text(const std::string& text, double x, double y, double line_height, Vec3f colour);
  double text_width(const std::string& text, double line_height) const;
  void add_axes();
  void add_scale_bar(const Overlays::ScaleBar& bar);

  /// A corner of a rectangle: on the screen, depth, and what its kind needs.
  struct Corner {
    float x, y;        ///< pixels, rows from the top
    float depth;       ///< orthographic: world length; else its reciprocal; 0: before all
    float u, v;        ///< of text: in the atlas; of a line: along and across it, pixels
    float half_width;  ///< of a line; 0: text
    float length;      ///< of a line, pixels
    float red, green, blue;
  };

  void add_rectangle(const std::array<Corner, 4>& corners);
  void add_projected(Vec3d from, Vec3d to, Vec3f colour, float width);
  /// Pixels of a line of text, about the same part of every picture.
  float unit_height() const;

  Camera camera_;
  int width_ = 0, height_ = 0;
  float scale_ = 1;
  std::vector<Corner> corners_;
  FontAtlas font_;
  GlTexture atlas_;
  GlProgram program_;
  GlVertexArray vertices_;
  GlBuffer buffer_;
};

/// The largest of 1, 2, 5 times a power of ten that is not above `length`.
double round_length(double length);

}  // namespace isobrick
