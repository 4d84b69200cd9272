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

namespace isobrick::inline v0 {

/// Overlays of a picture.
struct Overlays {
  struct Line {
    WorldLine line;
    Vec3f colour;
    float width;  ///< pixels
  };
  struct ScaleBar {
    std::string unit;
    double unit_length = 1;  ///< in world units
  };
  std::vector<Line> lines;
  bool axes = false;                  ///< world axes, in the lower left corner
  std::optional<ScaleBar> scale_bar;  ///< in the lower right corner
  float scale = 1;                    ///< PictureSettings::overlay_scale

  bool empty() const { return lines.empty() && !axes && !scale_bar; }
};

/// Draws lines and text on top of a finished picture.
class OverlayPass {
 public:
  OverlayPass();

  /// Draws overlays into a framebuffer, in a rectangle of width × height pixels at (left, 0), which
  /// shows the view of `camera`. They are faint behind the surfaces of `near_depth`, which may have
  /// another size. The uniform block of the frame must be bound.
  void run(const Overlays& overlays, const Camera& camera, unsigned framebuffer, int width,
           int height, const GlTexture& near_depth, int left = 0);

 private:
  void add_line(const WorldLine& line, Vec3f colour, float width);
  /// A line between pixel positions; never hidden.
  void add_flat_line(Vec3d from, Vec3d to, Vec3f colour, float width);
  void add_text(const std::string& text, double x, double y, double line_height, Vec3f colour);
  double text_width(const std::string& text, double line_height) const;
  void add_axes();
  void add_scale_bar(const Overlays::ScaleBar& bar);

  /// A vertex of a rectangle.
  struct Corner {
    float x, y;   ///< pixels, rows from the top
    float depth;  ///< orthographic: world length; else its reciprocal; 0: in front of everything
    float u, v;   ///< text: position in the atlas; line: pixels along and across it
    float half_width;  ///< of a line, pixels; 0: text
    float length;      ///< of a line, pixels
    float red, green, blue;
  };

  void add_rectangle(const std::array<Corner, 4>& corners);
  void add_projected(Vec3d from, Vec3d to, Vec3f colour, float width);
  /// Height of a line of text in pixels, a fixed fraction of the picture.
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

/// The largest number 1, 2 or 5 times a power of ten that is at most `length`.
double round_length(double length);

}  // namespace isobrick
