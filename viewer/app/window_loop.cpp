#include "viewer/app/viewer_window.h"

#include <epoxy/gl.h>
// After OpenGL's header.
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include <algorithm>
#include <utility>

#include "core/cancel.h"
#include "pipeline/value_text.h"
#include "viewer/app/panels.h"
#include "viewer/app/pick.h"
#include "viewer/app/window_events.h"

// The loop of a window: wait for events, draw, show.

namespace isobrick::inline v0 {
namespace {

/// Maximum step of motions; a longer frame is a pause.
constexpr double kMaxStepSeconds = 0.1;
/// Wait after a step that drew nothing new, while meshes arrive and nothing moves: the cores are
/// for meshes.
constexpr double kMeshWaitSeconds = 0.008;
/// Interval of frames while a picture is drawn in batches or meshes arrive, and nothing else
/// happens. More frames would delay software drawing; and with vertical sync a new picture would
/// wait behind a frame without anything new.
constexpr double kMaxFrameInterval = 0.25;
/// Interval for checking signals and counts while nothing happens.
constexpr double kIdleStep = 0.25;
/// Maximum number of separate messages about damage.
constexpr std::size_t kMaxReported = 3;
/// Previews last for this time after the last motion.
constexpr double kSettleSeconds = 0.25;

/// Whether the settings differ in more than colours, which change no mesh and need no preview.
bool values_differ(ViewSettings a, const ViewSettings& b) {
  a.background_top = b.background_top;
  a.background_bottom = b.background_bottom;
  for (std::size_t i = 0; i < std::min(a.surfaces.size(), b.surfaces.size()); ++i)
    a.surfaces[i].colour = b.surfaces[i].colour;
  return a != b;
}

}  // namespace

/// Shows each damage message once.
void ViewerWindow::report_damage() {
  if (const std::string why = state_.isovalue_stats->take_failure(); !why.empty())
    state_.show_message(why);
  for (const std::string& message : state_.scene_renderer->state().damage) {
    if (reported_damage_.size() > kMaxReported) return;
    if (!reported_damage_.insert(message).second) continue;
    state_.show_message(
        reported_damage_.size() <= kMaxReported
            ? message
            : "more is damaged: 'isobrick verify' names all bricks that cannot be read");
  }
}

/// Shows once, for each isovalue outside the range of the samples, why it has no surface.
void ViewerWindow::report_empty_surfaces() {
  if (is_moving()) return;  // a sliding isovalue passes quickly
  const ValueRange<double> range = state_.isovalue_stats->counts().range();
  for (const SurfaceSettings& surface : state_.settings.surfaces) {
    if (!surface.shown || reported_empty_.contains(surface.isovalue)) continue;
    const std::string why =
        why_out_of_range(range, state_.scene_renderer->store().info().type, 0, surface.isovalue);
    if (why.empty()) continue;
    reported_empty_.insert(surface.isovalue);
    state_.show_message(why);
  }
}

double ViewerWindow::still_time() const {
  return std::max(events_->last_motion(), open_time_) + kSettleSeconds;
}

bool ViewerWindow::is_moving() const {
  return state_.navigator.is_moving() || glfwGetTime() < still_time();
}

/// Draws the picture, or a batch of it.
void ViewerWindow::draw_picture(int width, int height) {
  SceneRenderer& scene_renderer = *state_.scene_renderer;
  const double begin = glfwGetTime();
  // The first picture of a store is a preview, too.
  surface_shown_ |= scene_renderer.state().covers;
  const bool preview = is_moving() || !surface_shown_;
  FrameOptions options = FrameOptions::in_window(state_.pacer, setup_->software(), preview);
  options.overlay_scale = scale_;
  options.batch_seconds = options_.batch_seconds.value_or(options.batch_seconds);
  const int size_divisor = preview ? state_.pacer.size_divisor() : 1;
  try {
    scene_renderer.draw(state_.navigator.camera, std::max(width / size_divisor, 1),
                        std::max(height / size_divisor, 1), state_.settings, options);
  } catch (const std::exception& e) {
    if (!std::exchange(draw_failed_, true)) state_.show_message(e.what());
    return;
  }
  draw_failed_ = false;
  pace(glfwGetTime() - begin);
  report_damage();
  report_empty_surfaces();
  repeat_clicks();
}

bool ViewerWindow::is_minimised() const {
  int width = 0, height = 0;
  glfwGetFramebufferSize(window_, &width, &height);
  return width == 0 || height == 0 || glfwGetWindowAttrib(window_, GLFW_ICONIFIED) == GLFW_TRUE;
}

ViewerWindow::WindowKey ViewerWindow::window_key() const {
  WindowKey key{.messages = state_.messages.size(),
                .converting = state_.import != nullptr,
                .panels = state_.panels,
                .help = state_.help};
  if (state_.scene_renderer == nullptr) return key;
  key.pictures = state_.scene_renderer->counters().finished;
  key.still = is_still();
  key.histogram = state_.isovalue_stats->histogram() != nullptr;
  return key;
}

/// Whether progress or a blinking cursor needs another frame.
bool ViewerWindow::is_due() const {
  const bool under_way = state_.import != nullptr || ImGui::GetIO().WantTextInput ||
                         (state_.scene_renderer != nullptr && !is_still());
  return under_way && glfwGetTime() - last_frame_time_ >= kMaxFrameInterval;
}

void ViewerWindow::begin_frame() {
  int width = 0, height = 0;
  glfwGetFramebufferSize(window_, &width, &height);
  glClearColor(0.2f, 0.21f, 0.23f, 1);
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  glViewport(0, 0, width, height);
  glClear(GL_COLOR_BUFFER_BIT);
  ImGui_ImplOpenGL3_NewFrame();
  ImGui_ImplGlfw_NewFrame();
  events_->hold_tapped_keys();
  ImGui::NewFrame();
}

void ViewerWindow::end_frame() {
  ImGui::Render();
  events_->release_tapped_keys();
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
  glfwSwapBuffers(window_);
}

/// Shows a frame with a line of text, before a long operation.
void ViewerWindow::show_notice(const std::string& text) {
  begin_frame();
  draw_notice(text);
  end_frame();
}

/// Shows a frame, unless it would equal the last one. `forced`: show it in any case.
void ViewerWindow::draw_frame(bool forced) {
  if (is_minimised()) return;
  const PictureArea area = picture_area();
  if (state_.scene_renderer != nullptr) draw_picture(area.width, area.height);
  const WindowKey key = window_key();
  if (!forced && key == last_frame_key_ && !is_due()) return;
  last_frame_key_ = key;
  const double now = glfwGetTime();
  state_.frame_seconds = now - std::exchange(last_frame_time_, now);
  state_.frame_times[state_.frame_number++ % state_.frame_times.size()] =
      static_cast<float>(state_.frame_seconds * 1e3);
  begin_frame();
  if (state_.scene_renderer != nullptr)
    state_.scene_renderer->renderer().copy_to(0, area.width, area.height, area.left);
  const ViewSettings settings = state_.settings;
  const Camera camera = state_.navigator.camera;
  draw_panels(state_);
  // Dragging a slider is a motion; clicking a widget is not.
  if (ImGui::IsMouseDown(ImGuiMouseButton_Left) && ImGui::IsAnyItemActive() &&
      (values_differ(settings, state_.settings) || camera != state_.navigator.camera))
    events_->moved();
  draw_measure(state_, area);
  end_frame();
}

/// Adapts the previews to the time that this thread took for a picture or a batch.
void ViewerWindow::pace(double seconds) {
  const SceneRenderer& scene_renderer = *state_.scene_renderer;
  // More to draw, a better picture to come, or other work.
  needs_draw_ = scene_renderer.state().drawing || scene_renderer.state().reduced_quality ||
                scene_renderer.state().needs_draw;
  if (!scene_renderer.has_new_frame()) return;
  state_.draw_seconds = std::max(seconds, scene_renderer.frame_seconds());
  if (scene_renderer.state().moving)
    state_.pacer.add_preview(state_.draw_seconds, scene_renderer.state().triangles,
                             scene_renderer.state().limited,
                             scene_renderer.state().thin_over_budget);
  else if (!scene_renderer.state().reduced_quality)
    state_.pacer.add_still(state_.draw_seconds, scene_renderer.state().triangles);
}

void ViewerWindow::wait(double max_seconds) {
  if (is_minimised()) return glfwWaitEventsTimeout(max_seconds);
  const bool has_store = state_.scene_renderer != nullptr;
  if (has_store && is_moving()) {
    // Until the next motion, or until the camera counts as still.
    if (!has_event_ && !needs_draw_ && !state_.navigator.is_moving() &&
        !state_.scene_renderer->has_new_frame())
      return glfwWaitEventsTimeout(std::clamp(still_time() - glfwGetTime(), kMeshWaitSeconds,
                                              std::max(max_seconds, kMeshWaitSeconds)));
    return glfwPollEvents();
  }
  if (!has_event_ && !needs_draw_ && (!has_store || state_.scene_renderer->state().complete))
    return glfwWaitEventsTimeout(max_seconds);
  const bool before = std::exchange(has_event_, false);
  glfwPollEvents();
  wait_for_meshes(max_seconds);
  has_event_ |= before;
}

void ViewerWindow::wait_for_meshes(double max_seconds) {
  if (state_.scene_renderer == nullptr || state_.scene_renderer->has_new_frame()) return;
  if (state_.scene_renderer->state().drawing || state_.scene_renderer->state().needs_draw) return;
  // Each new mesh ends a wait but needs no step. The last mesh and user input do.
  const SceneStream& stream = state_.scene_renderer->scene().stream();
  const double end = glfwGetTime() + std::min(kMeshWaitSeconds, max_seconds);
  for (double now = glfwGetTime(); !has_event_ && now < end && (draw_failed_ || !stream.idle());
       now = glfwGetTime())
    glfwWaitEventsTimeout(end - now);
}

bool ViewerWindow::step(double max_seconds) {
  wait(max_seconds);
  if (glfwWindowShouldClose(window_)) return false;
  // A panel may need a second frame to show the effect of an event.
  const bool event = std::exchange(has_event_, false),
             forced = std::exchange(had_event_, event) || event;
  needs_draw_ = false;
  const double now = glfwGetTime();
  const double seconds = now - std::exchange(last_time_, now);
  state_.navigator.update(std::min(seconds, kMaxStepSeconds));
  state_.drop_old_messages();
  handle_import();
  handle_requests();
  draw_frame(forced);
  return true;
}

void ViewerWindow::run() {
  while (!cancel_requested() && step(kIdleStep)) {
  }
}

}  // namespace isobrick
