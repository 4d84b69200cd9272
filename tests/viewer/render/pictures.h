#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <optional>
#include <vector>

#include "viewer/render/gl_context.h"
#include "viewer/render/renderer.h"

namespace isobrick::inline v0 {

/// Tests with a context of their own; skipped without EGL.
class RenderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!GlContext::available()) GTEST_SKIP() << "no OpenGL 4.5 without a window here";
    context_.emplace();
    renderer_.emplace();
  }
  void TearDown() override {
    renderer_.reset();
    context_.reset();
  }

  Renderer& renderer() { return *renderer_; }

 private:
  std::optional<GlContext> context_;
  std::optional<Renderer> renderer_;
};

/// The result of read_pixels() with its size.
struct Pixels {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgba;

  explicit Pixels(const Renderer& renderer)
      : width(renderer.width()), height(renderer.height()), rgba(renderer.read_pixels()) {}
  const std::uint8_t* at(int x, int y) const {
    return rgba.data() + 4 * (static_cast<std::ptrdiff_t>(y) * width + x);
  }
  int brightness(int x, int y) const { return at(x, y)[0] + at(x, y)[1] + at(x, y)[2]; }
  /// The background is bluish, meshes of the usual colour reddish.
  bool surface(int x, int y) const { return at(x, y)[0] > at(x, y)[2] + 8; }
  int count_surface() const {
    int count = 0;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) count += surface(x, y);
    return count;
  }
};

}  // namespace isobrick
