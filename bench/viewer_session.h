#pragma once

#include <epoxy/gl.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <utility>

#include <isobrick/error.h>
#include "bench/frame_times.h"
#include "viewer/app/frame_pacer.h"
#include "viewer/app/scene_renderer.h"
#include "viewer/render/gl_context.h"

namespace isobrick::bench {

using Clock = std::chrono::steady_clock;

/// Arguments of bench_viewer_stream.
struct Arguments {
  std::string store;
  double isovalue = 127.5, to = 160.5;
  int width = 1280, height = 800, jumps = 4, region = 256, turns = 5;
  double seconds = 4;  ///< of sliding, of turning
  double memory_gib = 2, gpu_memory_gib = 2;
  int threads = 0;
  std::string backend = "auto";
  bool json = false;
};

inline double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// A store drawn off-screen.
class Session {
 public:
  Session(const Arguments& arguments, const PictureBudgets& budgets,
          const std::shared_ptr<PictureSetup>& setup)
      : arguments_(arguments),
        opened_(Clock::now()),
        store_(std::make_shared<const StoreReader>(arguments.store)) {
    read_seconds = seconds_since(opened_);
    scene_renderer_ = std::make_unique<SceneRenderer>(
        store_, budgets, [this] { changed_ = Clock::now(); }, setup);
    set_up_seconds = seconds_since(opened_);
    settings.surfaces = {{arguments.isovalue, surface_colour(0), 1, true}};
    settings.multisample = !software_;
    choose_values(settings, scene_renderer_->scene().tree());
    const WorldBox box = scene_renderer_->bounds();
    camera.fit(box.lo, box.hi, static_cast<double>(arguments.width) / arguments.height);
  }

  SceneRenderer& renderer() { return *scene_renderer_; }
  double since_opened() const { return seconds_since(opened_); }
  /// Seconds from `start` until the last mesh arrived.
  double changed_after(Clock::time_point start) const {
    return std::chrono::duration<double>(changed_.load() - start).count();
  }

  /// Draws a frame as the window does. `moving`: it may be a preview.
  void draw(bool moving) { make_frame(moving); }
  /// Draws at most 60 frames per second until `done`. A frame that completes the scene need not
  /// wait for the next period, unless the previous one does. Throws Error after two minutes.
  template <class F>
  void draw_until(bool moving, F&& done) {
    const auto start = Clock::now();
    while (seconds_since(start) < 120) {
      const auto next = Clock::now() + kPeriod;
      draw(moving);
      if (done()) return;
      if (scene_renderer_->state().drawing) continue;
      const std::chrono::duration<double> left = next - Clock::now();
      const bool all_there = !moving && scene_renderer_->scene().stream().wait_idle(left.count());
      std::this_thread::sleep_until(all_there ? std::min(next, began_before_ + kPeriod) : next);
    }
    throw Error("what is waited for is not there after 120 s");
  }

  ViewSettings settings;
  Camera camera{{0.5, -1, 0.35}, {0, 0, 0}, {0, 0, 1}};
  double read_seconds = 0, set_up_seconds = 0;
  std::uint64_t device_peak = 0;
  Times at_rest;  ///< complete still frames in full quality

  /// Statistics since the last call: all frames, and finished frames other than at_rest.
  nlohmann::ordered_json take_times() {
    nlohmann::ordered_json json = std::exchange(frames_, {}).summary();
    json["whole_pictures"] = std::exchange(pictures_, {}).summary();
    return json;
  }

 private:
  static constexpr auto kPeriod = std::chrono::microseconds(16'667);
  static constexpr double kMin = 1e-3;  ///< seconds; shorter frames do not count

  void make_frame(bool moving) {
    const auto start = Clock::now();
    const FrameOptions options = FrameOptions::in_window(pacer_, software_, moving);
    const int size_divisor = moving ? pacer_.size_divisor() : 1;
    scene_renderer_->draw(camera, arguments_.width / size_divisor, arguments_.height / size_divisor,
                          settings, options);
    const double submitted = seconds_since(start);
    glFinish();
    const double seconds = seconds_since(start);
    const FrameState& state = scene_renderer_->state();
    if (seconds >= kMin) frames_.add(seconds, scene_renderer_->times(), seconds - submitted);
    device_peak = std::max(device_peak, state.device_bytes);
    if (scene_renderer_->has_new_frame() || state.needs_draw)
      began_before_ = std::exchange(began_, start);
    if (!scene_renderer_->has_new_frame()) return;  // the picture would be equal
    const double whole = std::max(seconds, scene_renderer_->frame_seconds());
    (!moving && state.complete && !state.reduced_quality ? at_rest : pictures_).add(whole);
    if (moving)
      pacer_.add_preview(whole, state.triangles, state.limited, state.thin_over_budget);
    else if (!state.reduced_quality)
      pacer_.add_still(whole, state.triangles);
  }

  const Arguments& arguments_;
  Clock::time_point opened_;
  Clock::time_point began_,
      began_before_;  ///< starts of the last two frames that a display may have shown
  std::atomic<Clock::time_point> changed_{Clock::time_point()};
  std::shared_ptr<const StoreReader> store_;
  std::unique_ptr<SceneRenderer> scene_renderer_;
  FrameTimings frames_;
  Times pictures_;
  const bool software_ = current_gl_device().software;
  FramePacer pacer_ = FramePacer::for_device(software_);
};

}  // namespace isobrick::bench
