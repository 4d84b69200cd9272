#include "viewer/render/font_atlas.h"

#include <isobrick/error.h>

#define STB_TRUETYPE_IMPLEMENTATION
#define STBTT_STATIC
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wshadow"
#include <stb/stb_truetype.h>
#pragma GCC diagnostic pop

// The assembler embeds the file.
__asm__(
    ".pushsection .rodata\n"
    "isobrick_font_begin:\n"
    ".incbin \"" ISOBRICK_FONT
    "\"\n"
    "isobrick_font_end:\n"
    ".byte 0\n"
    ".popsection\n");

namespace isobrick::inline v0 {

extern const char kFontBegin[] __asm__("isobrick_font_begin") __attribute__((visibility("hidden")));
extern const char kFontEnd[] __asm__("isobrick_font_end") __attribute__((visibility("hidden")));

std::string_view font_bytes() {
  return {kFontBegin, static_cast<std::size_t>(kFontEnd - kFontBegin)};
}

FontAtlas::FontAtlas(float height)
    : picture_(static_cast<std::size_t>(kEdge) * kEdge), height_(height) {
  const auto* font = reinterpret_cast<const unsigned char*>(font_bytes().data());
  std::array<stbtt_bakedchar, kCount> baked{};
  stbtt_fontinfo info;
  if (!stbtt_InitFont(&info, font, 0) ||
      stbtt_BakeFontBitmap(font, 0, height, picture_.data(), kEdge, kEdge, kFirst, kCount,
                           baked.data()) <= 0)
    throw Error("the embedded font cannot be drawn at this size");
  int ascent = 0, descent = 0, gap = 0;
  stbtt_GetFontVMetrics(&info, &ascent, &descent, &gap);
  ascent_ = static_cast<float>(ascent) * stbtt_ScaleForPixelHeight(&info, height);
  for (std::size_t i = 0; i < baked.size(); ++i) {
    const stbtt_bakedchar& c = baked[i];
    const auto wide = static_cast<float>(c.x1 - c.x0), high = static_cast<float>(c.y1 - c.y0);
    constexpr float scale = 1.0f / kEdge;
    glyphs_[i] = {c.x0 * scale, c.y0 * scale,  c.x1 * scale,  c.y1 * scale, c.xoff,
                  c.yoff,       c.xoff + wide, c.yoff + high, c.xadvance};
  }
}

const Glyph& FontAtlas::glyph_of(std::string_view text, std::size_t& at) const {
  const auto byte = [&](std::size_t i) {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u;
  };
  unsigned code = byte(at++);
  if (code >= 0xc0 && (byte(at) & 0xc0) == 0x80) code = (code & 0x1f) << 6 | (byte(at++) & 0x3f);
  while ((byte(at) & 0xc0) == 0x80) {  // skips the rest of longer sequences
    code = '?';
    ++at;
  }
  if (code == 0x3bc) code = 0xb5;  // Greek mu, as the micro sign
  if (code < kFirst || code >= kFirst + kCount) code = '?';
  return glyphs_[code - kFirst];
}

}  // namespace isobrick
