// Frames per second of a store while the camera orbits it, off-screen, as the window draws them
// (with previews if full frames take too long): from opening on, with all meshes resident, and
// while the isovalue slides. Then the time of a still frame, and of its draw batches, which delay
// input.
//
//   isobrick synth gyroid g.zarr --frequency 6 --dims 512,512,512 --type u8
//   bench_viewer_orbit g.zarr --isovalue 127.5 --to 140
//
// Frames follow each other without a pause; a frame's time ends with glFinish. Built as
// bench/README.md describes.

#include <epoxy/gl.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "bench/frame_times.h"
#include "bench/guarded_main.h"
#include "core/stopwatch.h"
#include "viewer/app/frame_pacer.h"
#include "viewer/app/scene_renderer.h"
#include "viewer/render/gl_context.h"

namespace isobrick::bench {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kTurn = 2 * 3.14159265358979;

struct Arguments {
  std::string store;
  double isovalue = 127.5, to = 140;
  int width = 1280, height = 800;
  double seconds = 8;  ///< of each phase: one orbit
  double memory_gib = 2;
  std::optional<double> batch_seconds;
  bool no_rest = false, pictures = false;
};

class Flight {
 public:
  explicit Flight(const Arguments& arguments) : arguments_(arguments) {
    PictureBudgets budgets;
    budgets.memory = static_cast<std::uint64_t>(arguments.memory_gib * (1 << 30));
    budgets.device_memory = budgets.memory;
    setup_ = std::make_shared<PictureSetup>(
        budgets, [] {}, PictureSize{arguments.width, arguments.height});
    scene_renderer_ = std::make_unique<SceneRenderer>(
        std::make_shared<const StoreReader>(arguments.store), budgets, [] {}, setup_);
    settings_.surfaces = {{arguments.isovalue, surface_colour(0), 1, true}};
    settings_.multisample = !current_gl_device().software;
    choose_values(settings_, scene_renderer_->scene().tree());
    const WorldBox box = scene_renderer_->bounds();
    camera_.fit(box.lo, box.hi, static_cast<double>(arguments.width) / arguments.height);
    start_ = camera_;
  }

  /// One orbit. `slide`: the isovalue goes to the other one and back.
  Json around(bool slide) {
    FrameTimings times;
    Json pictures = Json::array();
    double spent = 0;
    while (spent < arguments_.seconds) {
      const double part = spent / arguments_.seconds;
      camera_ = start_;
      camera_.orbit(part * kTurn, 0, {0, 0, 1});
      if (slide)
        settings_.surfaces[0].isovalue =
            arguments_.isovalue +
            (0.5 - 0.5 * std::cos(part * kTurn)) * (arguments_.to - arguments_.isovalue);
      Stopwatch watch;
      const double submitted =
          draw({.max_triangles = pacer_.max_triangles(),
                .thin_triangles = pacer_.thin_triangles(),
                .quality = pacer_.reduces_quality() ? FrameOptions::Quality::reduced
                                                    : FrameOptions::Quality::full,
                .size_divisor = pacer_.size_divisor()},
               pacer_.size_divisor());
      const double seconds = watch.lap();
      const FrameState& state = scene_renderer_->state();
      pictures.push_back({seconds * 1e3, pacer_.max_triangles(), pacer_.size_divisor(),
                          pacer_.reduces_quality(), state.nodes, state.triangles, state.covers});
      pacer_.add_preview(seconds, state.triangles, state.limited, state.thin_over_budget);
      times.add(seconds, scene_renderer_->times(), seconds - submitted);
      spent += seconds;
    }
    Json result = times.summary();
    if (arguments_.pictures)
      result["pictures_ms_max_smaller_plain_nodes_triangles_covers"] = pictures;
    return result;
  }

  /// Draws as a window without motion until the frame is complete. All frames but the last have
  /// reduced quality or lack meshes.
  Json rest() {
    FrameTimings steps;
    const std::uint64_t before = scene_renderer_->counters().finished;
    double all = 0, until_there = 0;
    do {
      FrameOptions options = FrameOptions::in_window(pacer_, current_gl_device().software, false);
      options.batch_seconds = arguments_.batch_seconds.value_or(options.batch_seconds);
      Stopwatch watch;
      scene_renderer_->draw(camera_, arguments_.width, arguments_.height, settings_, options);
      const double step = watch.lap();
      if (scene_renderer_->has_new_frame() || scene_renderer_->state().drawing)
        steps.add(step, scene_renderer_->times(), 0);
      all += step;
      if (!scene_renderer_->scene().stream().idle()) until_there = all;
      if (scene_renderer_->has_new_frame() && !scene_renderer_->state().reduced_quality)
        pacer_.add_still(scene_renderer_->frame_seconds(), scene_renderer_->state().triangles);
    } while (!scene_renderer_->state().complete || scene_renderer_->state().reduced_quality);
    return {{"seconds", all},
            {"seconds_until_meshes_are_there", until_there},
            {"pictures", scene_renderer_->counters().finished - before},
            {"last_picture_seconds", scene_renderer_->frame_seconds()},
            {"triangles", scene_renderer_->state().triangles},
            {"steps", steps.summary()}};
  }

 private:
  /// Seconds until all commands were submitted.
  double draw(const FrameOptions& options, int size_divisor) {
    Stopwatch watch;
    scene_renderer_->draw(camera_, arguments_.width / size_divisor,
                          arguments_.height / size_divisor, settings_, options);
    const double submitted = watch.lap();
    glFinish();
    return submitted;
  }

  const Arguments& arguments_;
  std::shared_ptr<PictureSetup> setup_;
  std::unique_ptr<SceneRenderer> scene_renderer_;
  ViewSettings settings_;
  Camera camera_{{0.5, -1, 0.35}, {0, 0, 0}, {0, 0, 1}};
  Camera start_;
  FramePacer pacer_ = FramePacer::for_device(current_gl_device().software);
};

int run(int argc, char** argv) {
  Arguments arguments;
  CLI::App app{"Pictures a second while the camera flies around a store"};
  app.add_option("store", arguments.store)->required();
  app.add_option("--isovalue", arguments.isovalue);
  app.add_option("--to", arguments.to, "Where sliding turns round");
  app.add_option("--seconds", arguments.seconds, "Once around");
  app.add_option("--width", arguments.width);
  app.add_option("--height", arguments.height);
  app.add_option("--memory", arguments.memory_gib, "GiB");
  app.add_flag("--no-rest", arguments.no_rest, "Do not wait until all is there");
  app.add_option("--batch", arguments.batch_seconds, "Seconds of a draw batch of a still frame");
  app.add_flag("--pictures", arguments.pictures, "Report every picture");
  CLI11_PARSE(app, argc, argv);

  const GlContext context;
  Json result{{"store", arguments.store}, {"renderer", current_gl_device().renderer}};
  Flight flight(arguments);
  result["from_opening_on"] = flight.around(false);
  if (!arguments.no_rest) {
    result["rest"] = flight.rest();
    result["all_there"] = flight.around(false);
  }
  result["sliding"] = flight.around(true);
  std::cout << result.dump(2) << '\n';
  return 0;
}

}  // namespace
}  // namespace isobrick::bench

int main(int argc, char** argv) {
  return isobrick::bench::guarded_main("bench_viewer_orbit", isobrick::bench::run, argc, argv);
}
