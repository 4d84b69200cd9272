#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

namespace isobrick::inline v0 {

/// The embedded font (DejaVu Sans, TrueType).
std::string_view font_bytes();

/// A glyph's rectangle in the atlas, and relative to the pen, in pixels of the atlas.
struct Glyph {
  float u0 = 0, v0 = 0, u1 = 0, v1 = 0;
  float x0 = 0, y0 = 0, x1 = 0, y1 = 0;  ///< from the pen on the base line, y down
  float advance = 0;
};

/// The glyphs of ASCII and Latin-1 in one 8-bit image.
class FontAtlas {
 public:
  /// `height`: of a line, in pixels.
  explicit FontAtlas(float height);

  int edge() const { return kEdge; }
  const std::vector<std::uint8_t>& picture() const { return picture_; }
  float height() const { return height_; }
  /// Distance from the top of a line to its base line.
  float ascent() const { return ascent_; }

  /// Calls f(glyph, pen x) for each character of UTF-8 text and returns the width. Characters
  /// beyond Latin-1 become '?'.
  template <class F>
  float place(std::string_view text, F&& f) const {
    float pen = 0;
    for (std::size_t i = 0; i < text.size();) {
      const Glyph& glyph = glyph_of(text, i);
      f(glyph, pen);
      pen += glyph.advance;
    }
    return pen;
  }
  /// Width of a line of text, in pixels.
  float width(std::string_view text) const {
    return place(text, [](const Glyph&, float) {});
  }

 private:
  static constexpr int kEdge = 512, kFirst = 32, kCount = 224;

  const Glyph& glyph_of(std::string_view text, std::size_t& at) const;

  std::vector<std::uint8_t> picture_;
  std::array<Glyph, kCount> glyphs_{};
  float height_, ascent_ = 0;
};

}  // namespace isobrick
