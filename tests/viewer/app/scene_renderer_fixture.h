#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <vector>

#include <isobrick/convert.h>
#include <isobrick/synth_source.h>
#include "tests/io/bytes/temp_dir.h"
#include "viewer/app/scene_renderer.h"
#include "viewer/render/gl_context.h"

namespace isobrick::inline v0 {

inline constexpr int kWidth = 320, kHeight = 240;

/// Pictures of synthetic volumes, off-screen.
class SceneRendererTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!GlContext::available()) GTEST_SKIP() << "there is no OpenGL 4.5";
    context_ = std::make_unique<GlContext>();
  }

  /// Opens a synthetic volume, seen from the front.
  void open(SynthKind kind, Int3 extent, PictureBudgets budgets = {}) {
    const auto source = make_synth({.kind = kind, .extent = extent});
    NoProgress progress;
    convert(*source, dir_ / "store.zarr", {.brick = 32, .force = true}, progress);
    show(budgets);
    settings_.surfaces = {{default_isovalue(ScalarType::u8), surface_colour(0), 1, true}};
    settings_.box = settings_.axes = settings_.scale_bar = false;
  }
  void show(PictureBudgets budgets = {}) {
    scene_renderer_.reset();
    scene_renderer_ = std::make_unique<SceneRenderer>(
        std::make_shared<const StoreReader>(dir_ / "store.zarr"), budgets, [] {});
    const WorldBox box = scene_renderer_->bounds();
    camera_.fit(box.lo, box.hi, static_cast<double>(kWidth) / kHeight);
  }
  void draw() {
    scene_renderer_->draw_complete(camera_, kWidth, kHeight, settings_, [] {});
  }
  /// Damages each of the larger files of level 0.
  void damage_bricks() {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(dir_ / "store.zarr/0")) {
      if (!entry.is_regular_file() || entry.path().extension() == ".json" ||
          entry.file_size() < 4096)
        continue;
      std::fstream file(entry.path(), std::ios::in | std::ios::out | std::ios::binary);
      file.seekp(static_cast<std::streamoff>(entry.file_size() / 3));
      file.write("damage", 6);
    }
  }
  std::vector<std::uint8_t> pixels() {
    draw();
    return scene_renderer_->renderer().read_pixels();
  }

  TempDir dir_;
  std::unique_ptr<GlContext> context_;
  std::unique_ptr<SceneRenderer> scene_renderer_;
  Camera camera_{{0.4, -1, 0.3}, {0, 0, 0}, {0, 0, 1}};
  ViewSettings settings_;
};

}  // namespace isobrick
